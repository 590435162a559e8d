// All pairs of triangles that overlap: within one scene, or between two.
#pragma once

#include <raydix/pairs.h>
#include <raydix/scene.h>
#include <raydix/scene_queries.h>

#include <compare>
#include <cstdint>
#include <vector>

namespace raydix {

/// Within one scene first < second; between two, `first` is of the first scene and `second` of the
/// second.
struct ScenePair {
    ScenePrimitive first, second;

    friend constexpr auto operator<=>(const ScenePair&, const ScenePair&) = default;
};
static_assert(sizeof(ScenePair) == 24);

/// Of one scene, instances counted on every way to them.
struct ScenePairCounts {
    std::uint64_t triangles = 0;
    std::uint64_t left_out = 0;  // of those: not finite, or out of range (mesh.h)
};

struct ScenePairs {
    std::vector<ScenePair> pairs;   // sorted
    ScenePairCounts first, second;  // `second`: of pairs between two scenes
};

struct ScenePairOptions {
    bool narrow = false;  // the triangles themselves must have a point in common, not only their
                          // boxes; decided without rounding, coplanar ones included
    std::uint32_t mask = 0xFFFFFFFFu;  // as that of a ray: which geometries and instances count
    /// Bounds the peak of the call: the copy of all triangles, its tree, and the pairs if they are
    /// kept. 0: half of what is left (result_limit.h).
    std::uint64_t max_result_bytes = 0;
    int threads = 0;  // 0 to 1,024; 0: all the machine has. Results do not depend on it
};

/// As overlapping_pairs of one mesh that holds all triangles of the scene's last commit, on every
/// path of instances, moved in double and rounded once (docs/algorithms/queries.md): each pair
/// once, sorted. Pairs within one scene that share a corner (the same place in the world, bit for
/// bit) are left out. None is ever dropped. Throws InputError: a scene that was never committed;
/// spheres, capsules, points or user geometry, which it names; more than 2^31 - 1 triangles on all
/// paths. ResultTooLarge: the call would take more than options.max_result_bytes; what copies and
/// trees take is known before any of it is there.
[[nodiscard]] ScenePairs overlapping_pairs(const Scene& scene,
                                           const ScenePairOptions& options = {});
[[nodiscard]] ScenePairs overlapping_pairs(const SceneD& scene,
                                           const ScenePairOptions& options = {});
/// Between two scenes. Nothing is left out.
[[nodiscard]] ScenePairs overlapping_pairs(const Scene& a, const Scene& b,
                                           const ScenePairOptions& options = {});
[[nodiscard]] ScenePairs overlapping_pairs(const SceneD& a, const SceneD& b,
                                           const ScenePairOptions& options = {});

/// How many there are, without keeping them.
[[nodiscard]] std::uint64_t count_overlapping_pairs(const Scene& scene,
                                                    const ScenePairOptions& options = {});
[[nodiscard]] std::uint64_t count_overlapping_pairs(const SceneD& scene,
                                                    const ScenePairOptions& options = {});
[[nodiscard]] std::uint64_t count_overlapping_pairs(const Scene& a, const Scene& b,
                                                    const ScenePairOptions& options = {});
[[nodiscard]] std::uint64_t count_overlapping_pairs(const SceneD& a, const SceneD& b,
                                                    const ScenePairOptions& options = {});

}  // namespace raydix
