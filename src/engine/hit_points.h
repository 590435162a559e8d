// Hits of a scene -> the triangles and shapes that they lie on, and their normals in the world.
#pragma once

#include <raydix/types.h>

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/double3.h"
#include "engine/scene_tree.h"
#include "engine/scene_tree_double.h"

namespace raydix {

/// The triangle of a hit in the space of its mesh, and the way from there to the world. Tree:
/// SceneTree or SceneTreeD.
template <class Tree>
struct BasicHitTriangle {
    using Instance = typename decltype(Tree::instances)::value_type;

    Double3 corners[3];
    std::uint32_t levels = 0;                // of instances
    const Instance* way[Scene::max_levels];  // [levels], the outermost first

    [[nodiscard]] Double3 point(double u, double v) const;
    /// Of any length; 0 if there is no area.
    [[nodiscard]] Double3 normal() const;
};

using HitTriangle = BasicHitTriangle<SceneTree>;

/// The instances on path `number`, the outermost first; how many.
std::uint32_t follow_path(const SceneTree& scene, std::uint32_t number,
                          const InstanceName* (&way)[Scene::max_levels]);

/// False: there is no such path, mesh or triangle. The hit is no miss.
[[nodiscard]] bool find_triangle(const SceneTree& scene, const Hit& hit, HitTriangle& triangle);

/// The geometric normal where a ray hit a triangle or shape, of any length. 0: user geometry, a
/// triangle without area, or a hit that the scene does not hold. The hit is no miss.
[[nodiscard]] Double3 normal_at(const SceneTree& scene, const Ray& ray, const Hit& hit);
[[nodiscard]] Double3 normal_at(const SceneTreeD& scene, const RayD& ray, const HitD& hit);

/// Throws InputError that names the first hit that is on no triangle and no shape, if there is one.
void require_normals(const SceneTree& scene, std::span<const Hit> hits, const char* call);
void require_normals(const SceneTreeD& scene, std::span<const HitD> hits, const char* call);

}  // namespace raydix
