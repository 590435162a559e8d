// The second half of the triangle test in vectors of doubles. Included once per instruction set.
#if defined(RAYDIX_SIMD_BLOCK_HITS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_BLOCK_HITS_H
#undef RAYDIX_SIMD_BLOCK_HITS_H
#else
#define RAYDIX_SIMD_BLOCK_HITS_H
#endif

#include <hwy/highway.h>

#include "trace/simd/lanes.h"
#include "trace/simd/wide_ray.h"
#include "trace/triangle_test.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

namespace weights {

#include "trace/corner_weights.h"

/// The floats that become a vector of doubles.
template <class D>
using HalfOf = hn::Rebind<float, D>;

template <class D>
HWY_INLINE hn::Vec<D> spread(D d, float x) {
    return hn::PromoteTo(d, hn::Set(HalfOf<D>(), x));
}

template <class D>
HWY_INLINE CornerWeights<hn::Vec<D>> weigh(D d, const hn::Vec<D> (&corner)[3][3],
                                           const hn::Vec<D> (&direction)[3]) {
    return weigh_corners(corner, direction, hn::Set(d, 1.0), [](hn::Vec<D> x) {
        const hn::RebindToUnsigned<D> bits;
        return hn::And(x, hn::BitCast(D(), hn::Set(bits, narrow_digits)));
    });
}

/// Bits of the lanes that hit_inside takes, too.
template <class D>
HWY_INLINE std::uint32_t inside(D d, const CornerWeights<hn::Vec<D>>& at) {
    const auto zero = hn::Zero(d);
    return bits_of(d, hn::And(hn::And(hn::Ge(at.u, zero), hn::Ge(at.v, zero)), hn::Ge(at.w, zero)));
}

/// As a float; -0 becomes +0.
template <class D>
HWY_INLINE hn::Vec<HalfOf<D>> rounded(D, hn::Vec<D> x) {
    const HalfOf<D> h;
    return hn::Add(hn::DemoteTo(h, x), hn::Zero(h));
}

/// What one ray hits of a block.
struct BlockHits {
    HWY_ALIGN float t[block_lanes], u[block_lanes], v[block_lanes];
};

/// hit_inside for one ray and the triangles in `wanted`: bits of those that are surely hit; the
/// others are left to test_exactly.
HWY_INLINE std::uint32_t hit_block(const TriangleBlock& block, const float* origin,
                                   const float* direction, const RayClass& kind,
                                   std::uint32_t wanted, BlockHits& hits) {
    using D = hn::CappedTag<double, block_lanes>;
    constexpr std::size_t lanes = hn::MaxLanes(D());
    const D d;
    const HalfOf<D> h;
    const std::uint32_t axis[3] = {kind.kx, kind.ky, kind.kz};
    std::uint32_t found = 0;
    for (std::size_t lane = 0; lane < block_lanes; lane += lanes) {
        if (lanes < block_lanes && (wanted >> lane & ((1u << lanes) - 1)) == 0) continue;
        hn::Vec<D> corner[3][3], way[3];
        for (std::uint32_t k = 0; k < 3; ++k) {
            const auto from = spread(d, origin[axis[k]]);
            way[k] = spread(d, direction[axis[k]]);
            for (std::uint32_t v = 0; v < 3; ++v)
                corner[v][k] = hn::Sub(
                    hn::PromoteTo(d, hn::Load(h, block.corner[3 * v + axis[k]] + lane)), from);
        }
        const auto at = weigh(d, corner, way);
        found |= inside(d, at) << lane;
        hn::Store(rounded(d, at.t), h, hits.t + lane);
        hn::Store(rounded(d, at.u), h, hits.u + lane);
        hn::Store(rounded(d, at.v), h, hits.v + lane);
    }
    return found & wanted;
}

}  // namespace weights

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
