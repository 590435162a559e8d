// A ray and the two children of a node pair: which of them it meets. The arithmetic has its fused
// multiply-adds written out, so that host and device agree to the bit.
#pragma once

#include <cmath>
#include <cstddef>

#include "base/device_math.h"
#include "base/hd.h"
#include "base/math.h"
#include "trace/warp/lane.h"

// Static: this is compiled for several instruction sets (lane.h).
#if defined(__FMA__) && defined(__SSE4_1__) && !defined(__CUDACC__) && !defined(RAYDIX_DEVICE_PASS)
#define RAYDIX_PAIRS_BY_VECTORS
#include <immintrin.h>

#include <utility>
#endif

namespace raydix {

/// Interval of the ray inside a box: planes in the order lo, hi of x, y, z.
RAYDIX_HD static inline void clip_to_box(const Lane& l, const float (&planes)[6], float& near,
                                         float& far) {
    const float x0 = multiply_add(planes[0], l.inverse.x, -l.scaled.x),
                x1 = multiply_add(planes[1], l.inverse.x, -l.scaled.x),
                y0 = multiply_add(planes[2], l.inverse.y, -l.scaled.y),
                y1 = multiply_add(planes[3], l.inverse.y, -l.scaled.y),
                z0 = multiply_add(planes[4], l.inverse.z, -l.scaled.z),
                z1 = multiply_add(planes[5], l.inverse.z, -l.scaled.z);
    near = greater(greater(lesser(x0, x1), lesser(y0, y1)), greater(lesser(z0, z1), l.tmin));
    far = lesser(lesser(greater(x0, x1), greater(y0, y1)), lesser(greater(z0, z1), l.t));
}

/// Which children of a pair a ray meets, and whether the second is closer.
struct PairVisit {
    bool first, second, second_is_closer;
};
#if defined(RAYDIX_PAIRS_BY_VECTORS)
/// What meet_pair does, the planes of two axes or of both children at a time.
static inline PairVisit meet_pair_by_vectors(const Lane& l, const NodePair& n) {
    const __m128 rates = _mm_loadu_ps(&l.inverse.x);  // x, y, z, no matter
    const __m128 from = _mm_loadu_ps(&l.scaled.x);    // x, y, z, tmin
    const __m128 xy = _mm_shuffle_ps(rates, rates, _MM_SHUFFLE(1, 1, 0, 0)),
                 xy_from = _mm_shuffle_ps(from, from, _MM_SHUFFLE(1, 1, 0, 0));
    const __m128 first = _mm_fmsub_ps(_mm_load_ps(&n.c0_xlo), xy, xy_from),
                 second = _mm_fmsub_ps(_mm_load_ps(&n.c1_xlo), xy, xy_from),
                 z = _mm_fmsub_ps(_mm_load_ps(&n.c0_zlo),
                                  _mm_shuffle_ps(rates, rates, _MM_SHUFFLE(2, 2, 2, 2)),
                                  _mm_shuffle_ps(from, from, _MM_SHUFFLE(2, 2, 2, 2)));
    // x and y of the first child, then of the second; z of both children, twice.
    const __m128 lo = _mm_shuffle_ps(first, second, _MM_SHUFFLE(2, 0, 2, 0)),
                 hi = _mm_shuffle_ps(first, second, _MM_SHUFFLE(3, 1, 3, 1)),
                 z_lo = _mm_shuffle_ps(z, z, _MM_SHUFFLE(2, 0, 2, 0)),
                 z_hi = _mm_shuffle_ps(z, z, _MM_SHUFFLE(3, 1, 3, 1));
    const __m128 enter = _mm_min_ps(lo, hi), leave = _mm_max_ps(lo, hi);
    const auto of_both = [](__m128 axes) {
        return std::pair{_mm_shuffle_ps(axes, axes, _MM_SHUFFLE(2, 0, 2, 0)),
                         _mm_shuffle_ps(axes, axes, _MM_SHUFFLE(3, 1, 3, 1))};
    };
    const auto [enter_x, enter_y] = of_both(enter);
    const auto [leave_x, leave_y] = of_both(leave);
    const __m128 tmin = _mm_shuffle_ps(from, from, _MM_SHUFFLE(3, 3, 3, 3)), t = _mm_set1_ps(l.t);
    const __m128 near =
        _mm_max_ps(_mm_max_ps(enter_x, enter_y), _mm_max_ps(_mm_min_ps(z_lo, z_hi), tmin));
    const __m128 far =
        _mm_min_ps(_mm_min_ps(leave_x, leave_y), _mm_min_ps(_mm_max_ps(z_lo, z_hi), t));
    const int met = _mm_movemask_ps(_mm_cmple_ps(near, far));
    return {(met & 1) != 0, (met & 2) != 0,
            _mm_comilt_ss(_mm_shuffle_ps(near, near, _MM_SHUFFLE(1, 1, 1, 1)), near) != 0};
}
#endif

RAYDIX_HD static inline PairVisit meet_pair(const Lane& l, const NodePair& n) {
#if defined(RAYDIX_PAIRS_BY_VECTORS)
    return meet_pair_by_vectors(l, n);
#else
    float near0, far0, near1, far1;
    clip_to_box(l, {n.c0_xlo, n.c0_xhi, n.c0_ylo, n.c0_yhi, n.c0_zlo, n.c0_zhi}, near0, far0);
    clip_to_box(l, {n.c1_xlo, n.c1_xhi, n.c1_ylo, n.c1_yhi, n.c1_zlo, n.c1_zhi}, near1, far1);
    return {near0 <= far0, near1 <= far1, near1 < near0};
#endif
}

}  // namespace raydix
