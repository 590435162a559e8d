// What batches of rays and queries take and give, the same for scenes and for trees alone.
#pragma once

#include <raydix/types.h>

#include <cstdint>
#include <string_view>
#include <vector>

namespace raydix {

/// How a batch goes through a wide tree. The hits do not depend on it.
enum class SimdPath : std::uint32_t {
    automatic = 0,  // what the order of the batch suggests. Large batches also try other ways and
                    // go on with the fastest
    single = 1,     // each ray alone, some of them in turn
    packet = 2,     // 64 neighbours together, with bounds around all of them
    stream = 3,     // thousands together: each node is tested with all rays that reach it
    sorted = 4,     // streams of rays that are neighbours in space, whatever their order
};
[[nodiscard]] std::string_view simd_path_name(SimdPath path);
/// Throws InputError that lists the known names.
[[nodiscard]] SimdPath simd_path_from_name(std::string_view name);

/// What a batch of rays met. The last two are of trees alone (trace.h, wide.h), if asked.
struct TraceCounts {
    std::uint64_t rays = 0;
    std::uint64_t hits = 0;  // rays that hit (all-hits: hits)
    std::uint64_t invalid_rays = 0;
    std::uint64_t node_visits =
        0;  // nodes entered, root included: inner ones test both children's boxes
    std::uint64_t triangle_tests = 0;
};

/// All hits of all rays. Those of ray i are [offsets[i], offsets[i + 1]) of `hits`, sorted by (t,
/// prim), in a scene by (t, instance, geometry, prim).
template <class Scalar>
struct BasicAllHits {
    std::vector<std::uint64_t> offsets;  // [rays + 1]
    std::vector<BasicHit<Scalar>> hits;
    TraceCounts counts;
};
using AllHits = BasicAllHits<float>;
using AllHitsD = BasicAllHits<double>;

/// What a batch of queries met.
struct QueryCounts {
    std::uint64_t queries = 0;
    std::uint64_t found = 0;  // queries that find or touch something, or are inside; of calls that
                              // list or count what is found: all of that
    std::uint64_t invalid_queries = 0;  // as their types say (types.h, shapes.h), or a coordinate
                                        // is NaN or infinite: they find and touch nothing
};

/// Options of queries for the closest point of one tree, and for signed distances.
template <class Scalar>
struct BasicClosestOptions {
    Scalar max_distance = infinity;  // only points with d2 <= R*R are found. A small one saves time
    int threads = 0;  // 0 to 1,024; 0: all the machine has. Results do not depend on it
};
using ClosestOptions = BasicClosestOptions<float>;
using ClosestOptionsD = BasicClosestOptions<double>;

}  // namespace raydix
