// intersect_slabs (slab.h) for the two children of a node at once, on the host: same bits, a third
// of the time. Lanes hold (near plane of a, near plane of b, far plane of a, far plane of b); far
// ones with the sign turned, so that one maximum serves all four.
#pragma once

#include <raydix/bvh.h>

#include "trace/slab.h"

#if defined(__SSE4_1__)
#include <smmintrin.h>
#endif

namespace raydix {

/// What two boxes gave: bit 0 of `hit` for the first, bit 1 for the second.
template <class Scalar>
struct BasicPairInterval {
    int hit;
    Scalar entry_a, entry_b;
};
using PairInterval = BasicPairInterval<float>;
using PairIntervalD = BasicPairInterval<double>;

#if defined(__SSE4_1__)

class HostSlabs {
public:
    explicit HostSlabs(const SlabFrame& ray, float tmin)
        : swap_(_mm_set_ps(0.0f, lane_sign(ray.near_z), lane_sign(ray.near_y),
                           lane_sign(ray.near_x))),
          origin_{_mm_set1_ps(ray.origin.x), _mm_set1_ps(ray.origin.y), _mm_set1_ps(ray.origin.z)},
          pad_{near_far(ray.near_pad.x, ray.far_pad.x), near_far(ray.near_pad.y, ray.far_pad.y),
               near_far(ray.near_pad.z, ray.far_pad.z)},
          inverse_{near_far(ray.inverse.x, -ray.inverse.x), near_far(ray.inverse.y, -ray.inverse.y),
                   near_far(ray.inverse.z, -ray.inverse.z)},
          start_(near_far(tmin, -infinity)) {}

    /// `pair` points to two nodes in a row.
    [[nodiscard]] PairInterval intersect(const BvhNode* pair, float tmax) const {
        const float* p = &pair->lo.x;
        const __m128 a_lo = _mm_load_ps(p), a_hi = _mm_load_ps(p + 4), b_lo = _mm_load_ps(p + 8),
                     b_hi = _mm_load_ps(p + 12);
        const __m128 a_near = _mm_blendv_ps(a_lo, a_hi, swap_),
                     a_far = _mm_blendv_ps(a_hi, a_lo, swap_);
        const __m128 b_near = _mm_blendv_ps(b_lo, b_hi, swap_),
                     b_far = _mm_blendv_ps(b_hi, b_lo, swap_);
        const __m128 near_xy = _mm_unpacklo_ps(a_near, b_near),
                     far_xy = _mm_unpacklo_ps(a_far, b_far);
        const __m128 near_z = _mm_unpackhi_ps(a_near, b_near),
                     far_z = _mm_unpackhi_ps(a_far, b_far);
        // The maximum returns its second operand if either is NaN: a NaN plane is dropped.
        __m128 t = _mm_max_ps(plane(_mm_movelh_ps(near_xy, far_xy), 0), start_);
        t = _mm_max_ps(plane(_mm_movehl_ps(far_xy, near_xy), 1), t);
        t = _mm_max_ps(plane(_mm_movelh_ps(near_z, far_z), 2), t);
        const __m128 turned = _mm_xor_ps(_mm_movehl_ps(t, t), _mm_set1_ps(-0.0f));
        const __m128 leave = _mm_mul_ps(turned, _mm_set1_ps(slab_exit_factor));
        const __m128 exit = _mm_min_ps(leave, _mm_set1_ps(tmax));
        return {_mm_movemask_ps(_mm_cmple_ps(t, exit)) & 3, _mm_cvtss_f32(t),
                _mm_cvtss_f32(_mm_shuffle_ps(t, t, 1))};
    }

private:
    static float lane_sign(int near) { return near != 0 ? -0.0f : 0.0f; }
    static __m128 near_far(float near, float far) { return _mm_set_ps(far, far, near, near); }
    [[nodiscard]] __m128 plane(__m128 at, int axis) const {
        return _mm_mul_ps(_mm_add_ps(_mm_sub_ps(at, origin_[axis]), pad_[axis]), inverse_[axis]);
    }
    __m128 swap_;
    __m128 origin_[3], pad_[3], inverse_[3];
    __m128 start_;
};

/// The same with lanes of doubles: (a, b), near and far planes apart.
class HostSlabsD {
public:
    explicit HostSlabsD(const SlabFrameD& ray, double tmin)
        : swap_(_mm_set_ps(0.0f, lane_sign(ray.near_z), lane_sign(ray.near_y),
                           lane_sign(ray.near_x))),
          origin_{_mm_set1_pd(ray.origin.x), _mm_set1_pd(ray.origin.y), _mm_set1_pd(ray.origin.z)},
          near_pad_{_mm_set1_pd(ray.near_pad.x), _mm_set1_pd(ray.near_pad.y),
                    _mm_set1_pd(ray.near_pad.z)},
          inverse_{_mm_set1_pd(ray.inverse.x), _mm_set1_pd(ray.inverse.y),
                   _mm_set1_pd(ray.inverse.z)},
          tmin_(_mm_set1_pd(tmin)) {}

    [[nodiscard]] PairIntervalD intersect(const BvhNode* pair, double tmax) const {
        const float* p = &pair->lo.x;
        const __m128 a_lo = _mm_load_ps(p), a_hi = _mm_load_ps(p + 4), b_lo = _mm_load_ps(p + 8),
                     b_hi = _mm_load_ps(p + 12);
        const __m128 a_near = _mm_blendv_ps(a_lo, a_hi, swap_),
                     a_far = _mm_blendv_ps(a_hi, a_lo, swap_);
        const __m128 b_near = _mm_blendv_ps(b_lo, b_hi, swap_),
                     b_far = _mm_blendv_ps(b_hi, b_lo, swap_);
        const __m128 near_xy = _mm_unpacklo_ps(a_near, b_near),
                     far_xy = _mm_unpacklo_ps(a_far, b_far);
        __m128d entry = _mm_max_pd(near_plane(near_xy, 0), tmin_);
        entry = _mm_max_pd(near_plane(_mm_movehl_ps(near_xy, near_xy), 1), entry);
        entry = _mm_max_pd(near_plane(_mm_unpackhi_ps(a_near, b_near), 2), entry);
        __m128d leave = _mm_min_pd(far_plane(far_xy, 0), _mm_set1_pd(infinity));
        leave = _mm_min_pd(far_plane(_mm_movehl_ps(far_xy, far_xy), 1), leave);
        leave = _mm_min_pd(far_plane(_mm_unpackhi_ps(a_far, b_far), 2), leave);
        leave = _mm_mul_pd(leave, _mm_set1_pd(slab_exit_factor_of<double>));
        const __m128d exit = _mm_min_pd(leave, _mm_set1_pd(tmax));
        return {_mm_movemask_pd(_mm_cmple_pd(entry, exit)), _mm_cvtsd_f64(entry),
                _mm_cvtsd_f64(_mm_unpackhi_pd(entry, entry))};
    }

private:
    static float lane_sign(int near) { return near != 0 ? -0.0f : 0.0f; }
    [[nodiscard]] __m128d near_plane(__m128 at, int axis) const {
        const __m128d off = _mm_sub_pd(_mm_cvtps_pd(at), origin_[axis]);
        return _mm_mul_pd(_mm_add_pd(off, near_pad_[axis]), inverse_[axis]);
    }
    [[nodiscard]] __m128d far_plane(__m128 at, int axis) const {
        const __m128d off = _mm_sub_pd(_mm_cvtps_pd(at), origin_[axis]);
        return _mm_mul_pd(_mm_sub_pd(off, near_pad_[axis]), inverse_[axis]);
    }
    __m128 swap_;
    __m128d origin_[3], near_pad_[3], inverse_[3];
    __m128d tmin_;
};

#else

template <class Scalar>
class BasicHostSlabs {
public:
    explicit BasicHostSlabs(const BasicSlabFrame<Scalar>& ray, Scalar tmin)
        : ray_(ray), tmin_(tmin) {}
    [[nodiscard]] BasicPairInterval<Scalar> intersect(const BvhNode* pair, Scalar tmax) const {
        const auto a = intersect_slabs(ray_, &pair[0].lo.x, tmin_, tmax);
        const auto b = intersect_slabs(ray_, &pair[1].lo.x, tmin_, tmax);
        return {(a.entry <= a.exit ? 1 : 0) | (b.entry <= b.exit ? 2 : 0), a.entry, b.entry};
    }

private:
    BasicSlabFrame<Scalar> ray_;
    Scalar tmin_;
};
using HostSlabs = BasicHostSlabs<float>;
using HostSlabsD = BasicHostSlabs<double>;

#endif

template <class Scalar>
using HostSlabsOf = std::conditional_t<std::is_same_v<Scalar, float>, HostSlabs, HostSlabsD>;

}  // namespace raydix
