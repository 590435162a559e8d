// Scaled copies of rays (scaled_rays.h), a vector of them at a time. Included once per instruction
// set.
#if defined(RAYDIX_SIMD_SCALE_RAYS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_SCALE_RAYS_H
#undef RAYDIX_SIMD_SCALE_RAYS_H
#else
#define RAYDIX_SIMD_SCALE_RAYS_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <limits>

#include "base/plain_scale.h"
#include "trace/simd/ray_vectors.h"
#include "trace/simd/scaled_rays.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// scaled_copy of rays[order[k]], or rays[k] without an order, for k from 0 to n - 1. `copies` and
/// `scales` have room for spare_scaled_rays more.
inline void scale_rays(const Ray* rays, const std::uint32_t* order, std::size_t n, Ray* copies,
                       float* scales) {
    static_assert(lanes16 <= spare_scaled_rays);
    const V16 zero = hn::Zero(f16), one = hn::Set(f16, 1.0f),
              most = hn::Set(f16, std::numeric_limits<float>::max());
    const auto exponents = hn::Set(I16(), 0x7F800000), twice_bias = hn::Set(I16(), 254 << 23);
    HWY_ALIGN std::int32_t index[lanes16];
    for (std::size_t k = 0; k < n; k += lanes16) {
        for (std::size_t l = 0; l < lanes16; ++l) {
            const std::size_t at = std::min(k + l, n - 1);
            index[l] = static_cast<std::int32_t>(order == nullptr ? at : order[at]);
        }
        RayVectors ray = read_rays(rays, index);
        const V16 ax = hn::Abs(ray.way[0]), ay = hn::Abs(ray.way[1]), az = hn::Abs(ray.way[2]);
        const V16 longest = hn::Max(hn::Max(ax, ay), az), tmin = ray.place[3], tmax = ray.way[3];
        const auto near = hn::And(hn::Gt(longest, hn::Set(f16, nearly_unit_from)),
                                  hn::Lt(longest, hn::Set(f16, nearly_unit_to)));
        // Valid, and of a length whose power of two and its inverse are ordinary numbers.
        const auto plain = hn::And(hn::Ge(longest, hn::Set(f16, plainly_scaled_from)),
                                   hn::Le(longest, hn::Set(f16, plainly_scaled_to)));
        const auto directed =
            hn::And(hn::And(hn::Le(ax, longest), hn::Le(ay, longest)), hn::Le(az, longest));
        const auto placed = hn::And(
            hn::And(hn::Le(hn::Abs(ray.place[0]), most), hn::Le(hn::Abs(ray.place[1]), most)),
            hn::Le(hn::Abs(ray.place[2]), most));
        const auto open = hn::And(hn::Le(tmin, tmax), hn::Ge(tmax, zero));
        const auto direct =
            hn::AndNot(near, hn::And(hn::And(plain, directed), hn::And(placed, open)));
        const auto power = hn::And(hn::BitCast(I16(), longest), exponents);
        const V16 length = hn::BitCast(f16, power),
                  by = hn::BitCast(f16, hn::Sub(twice_bias, power));
        const V16 least = hn::Set(f16, std::numeric_limits<float>::denorm_min());
        const V16 start =
                      hn::IfThenElseZero(hn::Gt(tmin, zero), hn::Max(hn::Mul(tmin, length), least)),
                  end = hn::Min(hn::Mul(hn::Min(tmax, most), length), most);
        const auto scaled = hn::And(direct, hn::Le(start, end));
        for (int a = 0; a < 3; ++a)
            ray.way[a] = hn::IfThenElse(scaled, hn::Mul(ray.way[a], by), ray.way[a]);
        ray.place[3] = hn::IfThenElse(scaled, start, tmin);
        ray.way[3] = hn::IfThenElse(scaled, end, tmax);
        const auto quad = [first = &copies[k].origin.x](std::size_t q) {
            return [=](std::size_t l) { return first + sizeof(Ray) / sizeof(float) * l + q; };
        };
        store_quads(ray.place, quad(0));
        store_quads(ray.way, quad(4));
        hn::StoreU(hn::IfThenElse(scaled, by, one), f16, scales + k);
        for (std::uint32_t left =
                 ~bits_of(f16, hn::Or(near, direct)) & ((std::uint32_t{1} << lanes16) - 1);
             left != 0; left &= left - 1) {
            const auto l = static_cast<std::size_t>(std::countr_zero(left));
            scales[k + l] = scaled_copy(rays[index[l]], copies[k + l]);
        }
    }
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
