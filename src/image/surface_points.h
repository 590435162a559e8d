// Hits -> the points that secondary rays start from. What render and make_secondary_rays share.
#pragma once

#include <raydix/bvh.h>
#include <raydix/scene.h>
#include <raydix/types.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "base/double3.h"
#include "engine/scene_tree.h"
#include "engine/scene_tree_double.h"
#include "image/primitive_lookup.h"
#include "rays/hemisphere_rays.h"

namespace raydix {

/// What was hit, as far as rays that start from its hits need to know. The tree must outlive it.
class BvhSurface {
public:
    explicit BvhSurface(const Bvh& bvh) : bvh_(bvh), lookup_(bvh) {}
    /// Around all of it; lo > hi if there is nothing.
    [[nodiscard]] Aabb bounds() const;
    /// Geometric, in the world, of any length and on either side; 0 or NaN if there is none.
    [[nodiscard]] Double3 normal(const Ray& ray, const Hit& hit) const;
    /// Throws InputError that names the first hit that is not on this surface.
    void check(std::span<const Hit> hits) const;

private:
    const Bvh& bvh_;
    PrimitiveLookup lookup_;
};

/// As the last commit left the scene. Throws InputError if there was none. User geometry has no
/// normal, and `check` refuses hits on it.
class SceneSurface {
public:
    explicit SceneSurface(const Scene& scene);
    [[nodiscard]] Aabb bounds() const;
    [[nodiscard]] Double3 normal(const Ray& ray, const Hit& hit) const;
    void check(std::span<const Hit> hits) const;

private:
    std::shared_ptr<const SceneTree> tree_;
};

/// The space whose origin is in the middle of a box.
struct SpaceAround {
    Double3 middle;
    Aabb bounds;  // the box in that space; lo > hi if it is empty
};
[[nodiscard]] SpaceAround space_around(const AabbD& box);

/// A scene in double in the space of its pictures, whose origin is the middle of the scene's box:
/// there floats are fine enough for all that is drawn. Rays and hits are in the scene's own space.
/// Otherwise as above.
class SceneSurfaceD {
public:
    explicit SceneSurfaceD(const SceneD& scene);
    [[nodiscard]] Aabb bounds() const { return space_.bounds; }
    [[nodiscard]] Double3 normal(const RayD& ray, const HitD& hit) const;
    void check(std::span<const HitD> hits) const;

    /// The origin of that space in the scene's.
    [[nodiscard]] Double3 middle() const { return space_.middle; }
    /// As surface_point.
    [[nodiscard]] SurfacePoint point(const RayD& ray, const HitD& hit, std::uint32_t pixel,
                                     double step_back) const;

private:
    std::shared_ptr<const SceneTreeD> tree_;
    SpaceAround space_;
};

/// Throws InputError "CALL needs a tree over triangles; this one holds ..." unless the tree is
/// empty or has them.
void require_triangles(const Bvh& bvh, std::string_view call);

/// `given`, or 5 % of the diagonal of `box` if it is 0. Throws InputError if it is negative or NaN.
[[nodiscard]] float ao_radius_or_default(const Aabb& box, float given);

/// How far secondary rays of pictures start before their surface: the protocol's distance, but
/// never less than what float32 can tell apart at the coordinates of `box` (the protocol's rays do
/// without: they must stay comparable).
[[nodiscard]] double step_back_distance(const Aabb& box);

/// Positions of the rays that hit something, ascending.
template <class Hits>
[[nodiscard]] std::vector<std::uint32_t> positions_of_hits(const Hits& hits) {
    std::vector<std::uint32_t> positions;
    positions.reserve(hits.size());
    for (std::size_t i = 0; i < hits.size(); ++i)
        if (hits[i].hit()) positions.push_back(static_cast<std::uint32_t>(i));
    return positions;
}

/// Rays of a space whose origin is at `middle` of another one -> the same there.
[[nodiscard]] std::vector<RayD> in_space_around(Double3 middle, std::span<const Ray> rays);

/// Origin `step_back` before the hit, geometric normal turned toward the ray. `normal`: of the
/// surface that was hit at t, on either side.
[[nodiscard]] SurfacePoint surface_point(const Double3& normal, const Ray& ray, float t,
                                         std::uint32_t pixel, double step_back);

}  // namespace raydix
