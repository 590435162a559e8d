// Rays through a scene for a caller that is a job of its own, such as a tile of a picture.
#pragma once

#include <raydix/types.h>

#include <cstdint>
#include <span>

#include "engine/scene_tree.h"
#include "engine/scene_tree_double.h"

namespace raydix {

/// What trace and trace_any answer to rays that see all masks, on the calling thread. The caller's
/// floating-point environment must be plain, as in the loops of parallel.h.
void closest_on_this_thread(const SceneTree& scene, std::span<const Ray> rays, std::span<Hit> hits);
void occluded_on_this_thread(const SceneTree& scene, std::span<const Ray> rays,
                             std::span<std::uint8_t> occluded);
void closest_on_this_thread(const SceneTreeD& scene, std::span<const RayD> rays,
                            std::span<HitD> hits);
void occluded_on_this_thread(const SceneTreeD& scene, std::span<const RayD> rays,
                             std::span<std::uint8_t> occluded);

/// How many nodes each ray visits on the way to its closest hit, going alone: those of trees over
/// parts and of trees of triangles. rays [n] -> visits [n].
void count_steps_on_this_thread(const SceneTree& scene, std::span<const Ray> rays,
                                std::span<std::uint32_t> visits);

}  // namespace raydix
