// All pairs of triangles that overlap: within one scene, or between two.
#pragma once

#include <raydix/scene.h>
#include <raydix/scene_queries.h>

#include <compare>
#include <cstdint>
#include <vector>

namespace raydix {

/// Within one scene first < second. Between two scenes `first` is of the first one and `second` of
/// the second one.
struct ScenePair {
    ScenePrimitive first, second;

    friend constexpr auto operator<=>(const ScenePair&, const ScenePair&) = default;
};
static_assert(sizeof(ScenePair) == 24);

/// What one scene gave; instances count on every way to them.
struct ScenePairCounts {
    std::uint64_t triangles = 0;
    std::uint64_t left_out = 0;  // of those: not finite, or out of range (mesh.h)
};

struct ScenePairs {
    std::vector<ScenePair> pairs;   // sorted
    ScenePairCounts first, second;  // `second`: of pairs between two scenes
};

struct ScenePairOptions {
    bool narrow = false;  // true: the triangles themselves must have a point in common, decided
                          // without rounding, coplanar ones included. false: their boxes
    std::uint32_t mask = 0xFFFFFFFFu;  // as that of a ray: which geometries and instances count
    /// The most bytes that the call may hold: the copy of all triangles, its tree, and the pairs if
    /// they are kept. 0: half of what is left to the process (result_limit.h).
    std::uint64_t max_result_bytes = 0;
    int threads = 0;  // 0 to 1,024; 0: all the machine has. Results do not depend on it
};

/// Finds all pairs of triangles whose boxes overlap or, with `narrow`, that meet themselves. Each
/// pair comes once, sorted. None is ever dropped.
///
/// The answer is that of overlapping_pairs on one mesh of all triangles of the last commit: on
/// every path of instances, moved in double and rounded once (docs/algorithms/queries.md). Pairs
/// within one scene that share a corner (the same place in the world, bit for bit) are left out.
///
/// Throws InputError: a scene that was never committed; spheres, capsules, points or user geometry
/// that the mask shows (they are named); more than 2^31 - 1 triangles on all paths. Throws
/// ResultTooLarge, an InputError, if the call would take more than options.max_result_bytes; for
/// copies and trees it does so before any of them is made.
[[nodiscard]] ScenePairs overlapping_pairs(const Scene& scene,
                                           const ScenePairOptions& options = {});
[[nodiscard]] ScenePairs overlapping_pairs(const SceneD& scene,
                                           const ScenePairOptions& options = {});
/// Between two scenes. Nothing is left out.
[[nodiscard]] ScenePairs overlapping_pairs(const Scene& a, const Scene& b,
                                           const ScenePairOptions& options = {});
[[nodiscard]] ScenePairs overlapping_pairs(const SceneD& a, const SceneD& b,
                                           const ScenePairOptions& options = {});

/// Counts the pairs without keeping them.
[[nodiscard]] std::uint64_t count_overlapping_pairs(const Scene& scene,
                                                    const ScenePairOptions& options = {});
[[nodiscard]] std::uint64_t count_overlapping_pairs(const SceneD& scene,
                                                    const ScenePairOptions& options = {});
[[nodiscard]] std::uint64_t count_overlapping_pairs(const Scene& a, const Scene& b,
                                                    const ScenePairOptions& options = {});
[[nodiscard]] std::uint64_t count_overlapping_pairs(const SceneD& a, const SceneD& b,
                                                    const ScenePairOptions& options = {});

}  // namespace raydix
