// Geometry of the caller's own in a Scene or a SceneD: boxes, and a function that knows what is in
// them. Spheres, capsules and points with a radius come with the library (Scene::add). Step by
// step: docs/add-a-geometry.md.
#pragma once

#include <raydix/scene.h>
#include <raydix/types.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>

namespace raydix {

/// Rays that reach one primitive of a user geometry, and where they hit it.
template <class Scalar>
class BasicRaysAtPrimitive {
public:
    using Ray = BasicRay<Scalar>;
    using TreeHit = BasicTreeHit<Scalar>;

    /// For the library. Arrays [count]; a place is the number of a ray among the caller's.
    BasicRaysAtPrimitive(const Ray* rays, const std::size_t* places, TreeHit* hits,
                         std::uint32_t count)
        : rays_(rays), places_(places), hits_(hits), count_(count) {}

    [[nodiscard]] std::uint32_t count() const { return count_; }
    /// Ray k in the geometry's own space, k < count(). tmax is its best hit so far.
    [[nodiscard]] const Ray& ray(std::uint32_t k) const { return rays_[k]; }
    /// Its place among the rays of the call. 0 where the call takes one ray.
    [[nodiscard]] std::size_t place(std::uint32_t k) const { return places_[k]; }
    /// Ray k hits the primitive at t. Ignored unless t is finite and in [tmin, tmax] of the ray.
    /// Of several hits the one with the least t counts. u and v go to the hit as they are.
    void hit(std::uint32_t k, Scalar t, Scalar u = 0, Scalar v = 0) {
        const Ray& ray = rays_[k];
        t += 0;  // -0 becomes +0
        if (!(t >= 0 && t >= ray.tmin && t <= ray.tmax && t <= std::numeric_limits<Scalar>::max()))
            return;
        TreeHit& known = hits_[k];
        if (known.hit() && known.t <= t) return;
        known.t = t;
        known.prim = 0;
        known.u = u, known.v = v;
    }

private:
    const Ray* rays_;
    const std::size_t* places_;
    TreeHit* hits_;
    std::uint32_t count_;
};
using RaysAtPrimitive = BasicRaysAtPrimitive<float>;
using RaysAtPrimitiveD = BasicRaysAtPrimitive<double>;

/// Primitives that the caller's own function intersects, as a geometry of a Scene.
template <class Scalar>
class BasicUserGeometry {
public:
    using Ray = BasicRay<Scalar>;
    using Hit = BasicHit<Scalar>;
    using Box = BasicAabb<Scalar>;
    using Rays = BasicRaysAtPrimitive<Scalar>;

    /// `boxes` [primitives] are around each primitive, in the geometry's own space. The caller
    /// keeps them until the scene has copied them (Scene::add). Primitives whose box is not finite,
    /// is empty or reaches beyond 1e12 are left out.
    ///
    /// `test` has one of these forms and is called inline from the loop over rays:
    ///     void test(std::uint32_t prim, RaysAtPrimitive& rays)
    ///     bool test(std::uint32_t prim, const Ray& ray, Hit& hit)
    /// The second sets t, u and v of `hit` and says whether there is one. A hit at t must lie
    /// within the primitive's box, up to 2^-17 of the distance that the ray has come; in double up
    /// to 2^-41 of that and 2^-44 of the box's largest coordinate. Else it may be missed. In double
    /// the function gets one ray at a time.
    ///
    /// A t that is computed in a wider type must be rounded to Scalar before it is compared with
    /// tmin and tmax. Else a t that rounds to tmax is refused, and which of equal hits counts
    /// depends on the path (SimdPath).
    ///
    /// Calls come from several threads at once and in any order. A ray that may hit a primitive is
    /// asked about once or several times; some rays that miss it are not asked about. Answers must
    /// depend on `prim` and the ray alone. The function may itself trace and query. What it throws
    /// comes out of the call that traces.
    template <class Test>
    requires(std::is_invocable_v<const Test&, std::uint32_t, Rays&> ||
             std::is_invocable_r_v<bool, const Test&, std::uint32_t, const Ray&, Hit&>)
        BasicUserGeometry(std::span<const Box> boxes, Test test)
        : boxes_(boxes),
          test_(std::make_shared<const Test>(std::move(test))),
          call_(&BasicUserGeometry::call<Test>) {}

    [[nodiscard]] std::span<const Box> boxes() const { return boxes_; }
    /// The same function around other boxes.
    [[nodiscard]] BasicUserGeometry around(std::span<const Box> boxes) const {
        BasicUserGeometry other = *this;
        other.boxes_ = boxes;
        return other;
    }
    void test(std::uint32_t prim, Rays& rays) const { call_(test_.get(), prim, rays); }

private:
    template <class Test>
    static void call(const void* with, std::uint32_t prim, Rays& rays) {
        const Test& test = *static_cast<const Test*>(with);
        if constexpr (std::is_invocable_v<const Test&, std::uint32_t, Rays&>) {
            test(prim, rays);
        } else {
            for (std::uint32_t k = 0; k < rays.count(); ++k) {
                Hit hit;
                if (test(prim, rays.ray(k), hit)) rays.hit(k, hit.t, hit.u, hit.v);
            }
        }
    }

    std::span<const Box> boxes_;
    std::shared_ptr<const void> test_;
    void (*call_)(const void* with, std::uint32_t prim, Rays& rays);
};
using UserGeometry = BasicUserGeometry<float>;
using UserGeometryD = BasicUserGeometry<double>;

}  // namespace raydix
