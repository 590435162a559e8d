// Rays at the leaves of a tree over spheres, capsules or primitives of the caller's. Included once
// per instruction set.
#if defined(RAYDIX_ENGINE_SHAPE_LEAVES_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_SHAPE_LEAVES_H
#undef RAYDIX_ENGINE_SHAPE_LEAVES_H
#else
#define RAYDIX_ENGINE_SHAPE_LEAVES_H
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <bit>
#include <cmath>
#include <limits>

#include "engine/scene_job.h"
#include "engine/shape_tree.h"
#include "proximity/shape_hits.h"
#include "trace/simd/children.h"
#include "trace/simd/lanes.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Asks for the cache lines of a node or leaf that will be visited soon. Without branches: which of
/// both it is cannot be foreseen.
RAYDIX_PREFETCHING void ask_for_shapes(const ShapeTree& tree, std::uint32_t word) {
    constexpr std::size_t line = 64, lines = (sizeof(WideNode) + line - 1) / line;
    const std::size_t place = (word & ~wide_leaf_bit) >> 3;
    const auto address = [](const auto* at) { return reinterpret_cast<std::uintptr_t>(at); };
    const std::uintptr_t node = address(tree.view.nodes) + std::size_t{word} * sizeof(WideNode),
                         leaf = tree.leaves + place * tree.leaf_bytes;
    const auto* const at = reinterpret_cast<const char*>(by_kind_of(word, node, leaf));
    for (std::size_t k = 0; k < lines; ++k) hwy::Prefetch(at + k * line);
}

/// A ray in the space of a geometry. Its direction is near unit length, by a power of two.
struct ShapeRay {
    Ray ray;                  // tmax: as far as it still goes
    float inverse, inverse2;  // of the direction's length, and of its square; about
    double scale;             // t of the caller's ray = scale * t here
    std::size_t place;        // among the caller's rays

    ShapeRay() = default;
    ShapeRay(const Ray& given, double t_scale, std::size_t at)
        : ray(given), scale(t_scale), place(at) {
        const Vec3 d = ray.direction;
        const float square = d.x * d.x + d.y * d.y + d.z * d.z;
        inverse2 = 1.0f / square;
        inverse = std::sqrt(inverse2);
    }
    /// `t` is one of the caller's.
    void end_at(float t) { ray.tmax = scale == 1.0 ? t : static_cast<float>(double{t} / scale); }
};

/// Bits of the spheres first[0] to first[count - 1] that the ray may hit, count <= sphere_lanes.
/// Those it does not have are farther from its line, or out of its reach, by more than floats can
/// err. With the center at f from the origin, the line's closest point is computed to within 2^-20
/// of |f|, and so is the place along the line (docs/algorithms/scenes.md).
HWY_INLINE std::uint32_t may_hit(const Sphere* first, std::uint32_t count, const ShapeRay& at) {
    using V = hn::Vec<F8>;
    const Ray& ray = at.ray;
    const V dx = hn::Set(f8, ray.direction.x), dy = hn::Set(f8, ray.direction.y),
            dz = hn::Set(f8, ray.direction.z);
    std::uint32_t bits = 0;
    for (std::size_t l = 0; l < sphere_lanes && l < count; l += lanes8) {
        V x, y, z, radius;
        hn::LoadInterleaved4(f8, &first[l].center.x, x, y, z, radius);
        const V fx = hn::Sub(hn::Set(f8, ray.origin.x), x),
                fy = hn::Sub(hn::Set(f8, ray.origin.y), y),
                fz = hn::Sub(hn::Set(f8, ray.origin.z), z);
        const V along = hn::MulAdd(fx, dx, hn::MulAdd(fy, dy, hn::Mul(fz, dz)));
        const V t = hn::Mul(along, hn::Set(f8, -at.inverse2));
        const V nx = hn::MulAdd(dx, t, fx), ny = hn::MulAdd(dy, t, fy), nz = hn::MulAdd(dz, t, fz);
        const V square = hn::MulAdd(nx, nx, hn::MulAdd(ny, ny, hn::Mul(nz, nz)));
        const V far = hn::Add(hn::Add(hn::Abs(fx), hn::Abs(fy)), hn::Abs(fz));
        const V room = hn::MulAdd(far, hn::Set(f8, 0x1p-19f), radius);
        const V most = hn::Mul(hn::Mul(room, room), hn::Set(f8, 1.0f + 0x1p-18f));
        const V stay = hn::Mul(room, hn::Set(f8, at.inverse * (1.0f + 0x1p-18f)));
        // NaN is no reason to leave one out, and neither is a product that overflows.
        const auto known = hn::Le(hn::Abs(along), hn::Set(f8, std::numeric_limits<float>::max()));
        const auto beside = hn::Gt(square, most);
        const auto behind = hn::Lt(hn::Add(t, stay), hn::Set(f8, ray.tmin)),
                   beyond = hn::Gt(hn::Sub(t, stay), hn::Set(f8, ray.tmax));
        bits |= (~bits_of(f8, hn::And(known, hn::Or(beside, hn::Or(behind, beyond))))) << l;
    }
    return bits & ((1u << count) - 1);
}

/// The primitives that a leaf names, for one ray. take(hit): t in the ray's units; says whether the
/// ray is done.
template <class Take>
HWY_INLINE bool hit_leaf(const ShapeTree& tree, std::uint32_t place, std::uint32_t count,
                         ShapeRay& at, const Take& take) {
    const std::uint32_t* const prims = tree.part.data() + place;
    if (!tree.spheres.empty()) {
        const Sphere* const first = tree.spheres.data() + place;
        for (std::uint32_t left = may_hit(first, count, at); left != 0; left &= left - 1) {
            const auto k = static_cast<std::uint32_t>(std::countr_zero(left));
            TreeHit hit;
            if (!hit_ball(first[k].center, first[k].radius, at.ray, hit)) continue;
            hit.prim = prims[k];
            if (take(hit)) return true;
        }
        return false;
    }
    for (std::uint32_t k = 0; k < count; ++k) {
        TreeHit hit;
        if (!hit_capsule(tree.capsules[place + k], at.ray, hit)) continue;
        hit.prim = prims[k];
        if (take(hit)) return true;
    }
    return false;
}

/// A ray near unit length as functions of the caller's get it: in the units of the caller's ray,
/// where floats hold its direction then.
struct UserRay {
    Ray ray;
    double scale;  // t of the caller's ray = scale * t here

    /// `tmin` and `tmax` are in the caller's units, `given` in those of `t_scale`.
    UserRay(const Ray& given, double t_scale, float tmin, float tmax) : ray(given), scale(t_scale) {
        if (scale != 1.0) unscale();
        if (scale == 1.0) ray.tmin = tmin, ray.tmax = tmax;
        ray.tmin = max_of(ray.tmin, 0.0f) + 0.0f;  // -0 becomes +0
    }

private:
    HWY_NOINLINE void unscale() {
        const auto back = [this](float d) { return static_cast<float>(double{d} / scale); };
        const Vec3 d = ray.direction, unscaled{back(d.x), back(d.y), back(d.z)};
        const auto exact = [this](float from, float to) {
            return double{to} * scale == double{from};
        };
        if (!exact(d.x, unscaled.x) || !exact(d.y, unscaled.y) || !exact(d.z, unscaled.z)) return;
        ray.direction = unscaled;
        scale = 1.0;
    }
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
