// What the lanes of a packet say of a node or a triangle that all of them test. A warp asks them
// one by one; the simulator's lies in one place, where eight lanes are asked at a time.
#pragma once

#include <cstdint>

#include "base/hd.h"
#include "simt/op.h"
#include "simt/thread_warp.h"
#include "trace/warp/lane.h"
#include "trace/warp/pair_visit.h"

#if defined(RAYDIX_PAIRS_BY_VECTORS) && defined(__AVX2__)
#define RAYDIX_PACKETS_BY_VECTORS
#include <cstddef>

#include "simt/simulated_warp.h"
#endif

namespace raydix {

/// All lanes are active whenever one of these is called. `op`: what is charged.
template <class Warp>
class PacketLanes {
public:
    RAYDIX_HD explicit PacketLanes(const Warp&) {}

    /// All lanes test both children of a pair, which becomes `pair`.
    RAYDIX_HD void meet(Warp& warp, Op op, const NodePair* from, NodePair& pair) {
        warp.step(op, [&](Lane& l) {
            pair = *from;
            const PairVisit met = meet_pair(l, pair);
            const bool rather_second = met.second && (met.second_is_closer || !met.first);
            l.meets = (met.first ? 1u : 0u) | (met.second ? 2u : 0u) | (rather_second ? 4u : 0u);
        });
    }
    /// Of those that meet the first child; the second; that would go to the second before the
    /// first.
    RAYDIX_HD auto first(Warp& warp, Op op) { return ballot<1>(warp, op); }
    RAYDIX_HD auto second(Warp& warp, Op op) { return ballot<2>(warp, op); }
    RAYDIX_HD auto rather_second(Warp& warp, Op op) { return ballot<4>(warp, op); }

    /// Whether no lane hits the triangle. Its test is charged then, and need not be done. False
    /// where that is not known.
    RAYDIX_HD bool pass_by(Warp&, const WoopTriangle&) { return false; }
    /// Lanes have another interval.
    RAYDIX_HD void look_again(const Warp&) {}

private:
    template <std::uint32_t bit>
    RAYDIX_HD static auto ballot(Warp& warp, Op op) {
        return warp.ballot(op, [](const Lane& l) { return (l.meets & bit) != 0; });
    }
};

#if defined(RAYDIX_PACKETS_BY_VECTORS)
/// The same numbers.
template <int width, class Isa>
requires(width % 8 == 0) class PacketLanes<SimulatedWarp<Lane, width, Isa>> {
    using Warp = SimulatedWarp<Lane, width, Isa>;
    using Mask = typename Warp::Mask;
    static constexpr int vectors = width / 8;

public:
    explicit PacketLanes(const Warp& warp) {
        for (int axis = 0; axis < 3; ++axis) {
            read(warp, origin_[axis], [axis](const Lane& l) { return (&l.origin.x)[axis]; });
            read(warp, direction_[axis], [axis](const Lane& l) { return (&l.direction.x)[axis]; });
            read(warp, inverse_[axis], [axis](const Lane& l) { return (&l.inverse.x)[axis]; });
            read(warp, scaled_[axis], [axis](const Lane& l) { return (&l.scaled.x)[axis]; });
        }
        look_again(warp);
    }

    void meet(Warp& warp, Op op, const NodePair* from, NodePair& pair) {
        warp.issue(op);
        pair = *from;
        first_ = second_ = rather_second_ = 0;
        for (int k = 0; k < vectors; ++k) {
            __m256 near0, far0, near1, far1;
            clip(k, {pair.c0_xlo, pair.c0_xhi, pair.c0_ylo, pair.c0_yhi, pair.c0_zlo, pair.c0_zhi},
                 near0, far0);
            clip(k, {pair.c1_xlo, pair.c1_xhi, pair.c1_ylo, pair.c1_yhi, pair.c1_zlo, pair.c1_zhi},
                 near1, far1);
            const Mask first = mask_of(_mm256_cmp_ps(near0, far0, _CMP_LE_OQ)),
                       second = mask_of(_mm256_cmp_ps(near1, far1, _CMP_LE_OQ)),
                       second_is_closer = mask_of(_mm256_cmp_ps(near1, near0, _CMP_LT_OQ));
            first_ |= first << (8 * k);
            second_ |= second << (8 * k);
            rather_second_ |= (second & (second_is_closer | ~first)) << (8 * k);
        }
    }
    Mask first(Warp& warp, Op op) const { return warp.issue(op), first_; }
    Mask second(Warp& warp, Op op) const { return warp.issue(op), second_; }
    Mask rather_second(Warp& warp, Op op) const { return warp.issue(op), rather_second_; }

    bool pass_by(Warp& warp, const WoopTriangle& triangle) const {
        Mask in_range = 0;
        for (int k = 0; k < vectors; ++k) {
            // test_plane, then test_edges where a lane needs them
            const __m256 t = _mm256_div_ps(start(triangle.z, k, -1), slope(triangle.z, k));
            const Mask here = mask_of(_mm256_and_ps(_mm256_cmp_ps(t, tmin_[k], _CMP_GE_OQ),
                                                    _mm256_cmp_ps(t, t_[k], _CMP_LE_OQ)));
            if (here == 0) continue;
            in_range |= here << (8 * k);
            const __m256 u = _mm256_fmadd_ps(t, slope(triangle.x, k), start(triangle.x, k, 1)),
                         v = _mm256_fmadd_ps(t, slope(triangle.y, k), start(triangle.y, k, 1));
            const __m256 zero = _mm256_setzero_ps(), one = _mm256_set1_ps(1.0f);
            const __m256 inside =
                _mm256_and_ps(_mm256_and_ps(_mm256_cmp_ps(u, zero, _CMP_GE_OQ),
                                            _mm256_cmp_ps(v, zero, _CMP_GE_OQ)),
                              _mm256_cmp_ps(_mm256_add_ps(u, v), one, _CMP_LE_OQ));
            if ((here & mask_of(inside)) != 0) return false;
        }
        warp.touches(
            Access::read, [&](const Lane&) { return triangle.z; }, sizeof(triangle.z));
        warp.issue(Op::test_triangle);
        warp.among(in_range, [&] {
            warp.touches(
                Access::read, [&](const Lane&) { return triangle.x; },
                sizeof(triangle.x) + sizeof(triangle.y));
            warp.issue(Op::test_edges);
        });
        return true;
    }
    void look_again(const Warp& warp) {
        read(warp, tmin_, [](const Lane& l) { return l.tmin; });
        read(warp, t_, [](const Lane& l) { return l.t; });
    }

private:
    template <class Value>
    static void read(const Warp& warp, __m256 (&to)[vectors], Value value) {
        for (int k = 0; k < vectors; ++k) {
            float eight[8];
            for (std::size_t l = 0; l < 8; ++l)
                eight[l] = value(warp.lanes[8 * static_cast<std::size_t>(k) + l]);
            to[k] = _mm256_loadu_ps(eight);
        }
    }
    static Mask mask_of(__m256 is) { return static_cast<Mask>(_mm256_movemask_ps(is)); }

    /// A row of a triangle at the origins (sign -1: of its rotation, turned round), and along the
    /// directions.
    __m256 start(const float (&row)[4], int k, float sign) const {
        __m256 sum = _mm256_set1_ps(row[3]);
        for (int axis = 2; axis >= 0; --axis)
            sum = _mm256_fmadd_ps(_mm256_set1_ps(sign * row[axis]), origin_[axis][k], sum);
        return sum;
    }
    __m256 slope(const float (&row)[4], int k) const {
        __m256 sum = _mm256_mul_ps(_mm256_set1_ps(row[2]), direction_[2][k]);
        for (int axis = 1; axis >= 0; --axis)
            sum = _mm256_fmadd_ps(_mm256_set1_ps(row[axis]), direction_[axis][k], sum);
        return sum;
    }
    /// clip_to_box
    void clip(int k, const float (&planes)[6], __m256& near, __m256& far) const {
        const auto at = [&](int plane) {
            return _mm256_fmsub_ps(_mm256_set1_ps(planes[plane]), inverse_[plane / 2][k],
                                   scaled_[plane / 2][k]);
        };
        const __m256 x0 = at(0), x1 = at(1), y0 = at(2), y1 = at(3), z0 = at(4), z1 = at(5);
        near = _mm256_max_ps(_mm256_max_ps(_mm256_min_ps(x0, x1), _mm256_min_ps(y0, y1)),
                             _mm256_max_ps(_mm256_min_ps(z0, z1), tmin_[k]));
        far = _mm256_min_ps(_mm256_min_ps(_mm256_max_ps(x0, x1), _mm256_max_ps(y0, y1)),
                            _mm256_min_ps(_mm256_max_ps(z0, z1), t_[k]));
    }

    __m256 origin_[3][vectors], direction_[3][vectors], inverse_[3][vectors], scaled_[3][vectors],
        tmin_[vectors], t_[vectors];
    Mask first_ = 0, second_ = 0, rather_second_ = 0;
};
#endif

}  // namespace raydix
