// Rays through a tree: closest, any and all hits, in batches over threads or one by one.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include <cstdint>
#include <span>
#include <string>
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

struct TraceOptions {
    int threads = 0;        // 0 to 1,024; 0: all the machine has. Results do not depend on it
    bool counters = false;  // also count node visits and triangle tests; costs a little time
    SimdPath path = SimdPath::automatic;  // wide trees only
    std::string isa = {};  // wide trees only: one of simd_instruction_sets(); empty: the best
    /// trace_all only: the most bytes that the call may hold. 0: half of what is left to the
    /// process (result_limit.h).
    std::uint64_t max_result_bytes = 0;
};

/// What a batch met. The last two are 0 unless TraceOptions::counters asks for them.
struct TraceCounts {
    std::uint64_t rays = 0;
    std::uint64_t hits = 0;  // rays that hit (all-hits: hits)
    std::uint64_t invalid_rays = 0;
    std::uint64_t node_visits =
        0;  // nodes entered, root included: inner ones test both children's boxes
    std::uint64_t triangle_tests = 0;
};

/// Finds the closest hit of each ray: the least (t, prim) over all triangles that the watertight
/// test accepts (Woop, Benthin, Wald 2013). rays [n] -> hits [n]. An edge belongs to both of its
/// triangles. The hits have the same bits for every builder, kernel and number of threads. Invalid
/// rays (types.h) miss and are counted. Throws InputError: sizes that differ, an option out of
/// range, a tree that holds boxes or points.
TraceCounts trace(const Bvh& bvh, std::span<const Ray> rays, std::span<Hit> hits,
                  const TraceOptions& options = {});
[[nodiscard]] std::vector<Hit> trace(const Bvh& bvh, std::span<const Ray> rays,
                                     const TraceOptions& options = {});

/// Says whether each ray hits anything at all: 1 or 0. rays [n] -> occluded [n]. Errors as above.
TraceCounts trace_any(const Bvh& bvh, std::span<const Ray> rays, std::span<std::uint8_t> occluded,
                      const TraceOptions& options = {});

/// All hits of all rays. Those of ray i are [offsets[i], offsets[i + 1]) of `hits`, sorted by (t,
/// prim), in a scene by (t, instance, geometry, prim).
struct AllHits {
    std::vector<std::uint64_t> offsets;  // [rays + 1]
    std::vector<Hit> hits;
    TraceCounts counts;
};

/// As AllHits, in double.
struct AllHitsD {
    std::vector<std::uint64_t> offsets;  // [rays + 1]
    std::vector<HitD> hits;
    TraceCounts counts;
};

/// Finds all hits of all rays, each triangle at most once a ray. An edge belongs to one of its
/// triangles here, so that the number of crossings of a closed mesh is right for rays through edges
/// and vertices too. Throws ResultTooLarge, an InputError, if the call would take more than
/// options.max_result_bytes; no hit is ever dropped.
[[nodiscard]] AllHits trace_all(const Bvh& bvh, std::span<const Ray> rays,
                                const TraceOptions& options = {});

/// One ray, on the caller's thread.
[[nodiscard]] Hit closest_hit(const Bvh& bvh, const Ray& ray);
[[nodiscard]] bool any_hit(const Bvh& bvh, const Ray& ray);

/// Gives the answers of `trace` by testing every triangle. Slow, and independent of any tree.
[[nodiscard]] std::vector<Hit> trace_brute_force(const MeshView& mesh, std::span<const Ray> rays,
                                                 int threads = 0);

}  // namespace raydix
