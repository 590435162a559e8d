// Rays through a tree: closest, any and all hits, in batches over threads or one by one.
#pragma once

#include <raydix/batch.h>
#include <raydix/bvh.h>
#include <raydix/mesh.h>
#include <raydix/types.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace raydix {

struct TraceOptions {
    int threads = 0;        // 0 to 1,024; 0: all the machine has. Results do not depend on it
    bool counters = false;  // also count node visits and triangle tests; costs a little time
    SimdPath path = SimdPath::automatic;  // wide trees only
    std::string isa = {};  // wide trees only: one of simd_instruction_sets(); empty: the best
    /// trace_all only: the most bytes that the call may hold. 0: half of what is left to the
    /// process (result_limit.h).
    std::uint64_t max_result_bytes = 0;
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
