#include "tree/small_splits.h"

#include <bit>

#include "base/float4.h"
#include "base/math.h"
#include "base/x86_intrinsics.h"

#if defined(RAYDIX_X86_INTRINSICS)
#define RAYDIX_WITH_WIDE_LANES
#define RAYDIX_AVX2 __attribute__((target("avx2")))
#define RAYDIX_AVX512 __attribute__((target("avx512f")))
#define RAYDIX_INLINE inline __attribute__((always_inline))
#endif

namespace raydix {
namespace {

/// Bit k of a lane's number, as sets of lanes: box k of a few goes left in these.
constexpr std::array<LaneSet, 5> lanes_with_bit{0xAAAA, 0xCCCC, 0xF0F0, 0xFF00, 0};
/// Up to this many boxes have no more divisions than there are lanes.
constexpr int few_boxes = 5;

/// The least cost of all lanes and axes, and where it was found.
struct Found {
    float cost = infinity;
    std::size_t axis = 0;  // or any of few boxes
    LaneSet lane = 0;
};

/// The lower half of a set.
LaneSet lower_half(LaneSet set) {
    LaneSet half = set;
    for (int k = std::popcount(set) / 2; k > 0; --k) half &= half - 1;
    return set & ~half;
}

/// The lanes of a set that have bits in `number`, its lowest bit standing for its lowest lane.
LaneSet spread_over(LaneSet number, LaneSet set) {
    LaneSet lanes = 0;
    for (; set != 0; set &= set - 1, number >>= 1)
        if ((number & 1) != 0) lanes |= set & (0u - set);
    return lanes;
}

/// Lanes of `set` whose centroids are not above that of a lane.
LaneSet up_to(const std::array<float, small_boxes>& center2, LaneSet set, LaneSet lane) {
    LaneSet lanes = 0;
    for (LaneSet rest = set; rest != 0; rest &= rest - 1)
        if (center2[static_cast<std::size_t>(std::countr_zero(rest))] <= center2[lane])
            lanes |= rest & (0u - rest);
    return lanes;
}

/// Four candidates: the boxes on both sides.
struct Sides4 {
    std::array<Float4, 6> left, right;
    Float4 left_count = Float4::all(0), right_count = Float4::all(0);

    Sides4() {
        left.fill(Float4::all(infinity));
        right.fill(Float4::all(infinity));
    }
    void add(const SmallBoxes& boxes, std::size_t box, Mask4 goes_left) {
        const Float4 none = Float4::all(infinity), zero = Float4::all(0), one = Float4::all(1);
        for (std::size_t c = 0; c < 6; ++c) {
            const Float4 value = Float4::all(boxes.at[c][box]);
            left[c] = min_of(left[c], select(goes_left, value, none));
            right[c] = min_of(right[c], select(goes_left, none, value));
        }
        left_count = left_count + select(goes_left, one, zero);
        right_count = right_count + select(goes_left, zero, one);
    }
    /// NaN where a side is empty.
    [[nodiscard]] Float4 cost() const {
        const auto area = [](const std::array<Float4, 6>& box) {
            const Float4 x = box[0] + box[3], y = box[1] + box[4], z = box[2] + box[5];
            return (x * y + y * z) + z * x;
        };
        return area(left) * left_count + area(right) * right_count;
    }
};

/// Takes the lowest lane that is below what was found before.
template <std::size_t lanes>
void take(Found& found, const std::array<float, lanes>& costs, std::size_t axis, LaneSet first,
          LaneSet valid) {
    for (LaneSet k = 0; k < lanes; ++k)
        if ((valid >> (first + k) & 1) != 0 && costs[k] < found.cost)
            found = {costs[k], axis, first + k};
}

Found best_of_few_4(const SmallBoxes& boxes, LaneSet set, LaneSet valid) {
    Found found;
    for (LaneSet first = 0; first < small_boxes && valid >> first != 0; first += 4) {
        Sides4 sides;
        std::size_t k = 0;
        for (LaneSet rest = set; rest != 0; rest &= rest - 1, ++k) {
            const bool last = (rest & (rest - 1)) == 0;
            const LaneSet bits = last ? 0 : lanes_with_bit[k] >> first;
            const std::array<std::uint32_t, 4> mask{0 - (bits & 1), 0 - (bits >> 1 & 1),
                                                    0 - (bits >> 2 & 1), 0 - (bits >> 3 & 1)};
            sides.add(boxes, static_cast<std::size_t>(std::countr_zero(rest)),
                      Mask4::load(mask.data()));
        }
        std::array<float, 4> costs;
        sides.cost().store(costs.data());
        take(found, costs, 0, first, valid);
    }
    return found;
}

Found best_plane_4(const SmallBoxes& boxes, LaneSet set) {
    Found found;
    for (std::size_t axis = 0; axis < 3; ++axis)
        for (LaneSet first = 0; first < small_boxes; first += 4) {
            if ((set >> first & 15) == 0) continue;
            const Float4 plane = Float4::load(boxes.at[6 + axis].data() + first);
            Sides4 sides;
            for (LaneSet rest = set; rest != 0; rest &= rest - 1) {
                const auto box = static_cast<std::size_t>(std::countr_zero(rest));
                sides.add(boxes, box, Float4::all(boxes.at[6 + axis][box]) <= plane);
            }
            std::array<float, 4> costs;
            sides.cost().store(costs.data());
            take(found, costs, axis, first, set);
        }
    return found;
}

#if defined(RAYDIX_WITH_WIDE_LANES)

struct Sides8 {
    __m256 left[6], right[6], left_count;
};
RAYDIX_AVX2 RAYDIX_INLINE void begin_8(Sides8& s) {
    for (int c = 0; c < 6; ++c) s.left[c] = s.right[c] = _mm256_set1_ps(infinity);
    s.left_count = _mm256_setzero_ps();
}
RAYDIX_AVX2 RAYDIX_INLINE void add_8(Sides8& s, const SmallBoxes& boxes, std::size_t box,
                                     __m256 goes_left) {
    const __m256 none = _mm256_set1_ps(infinity);
    for (std::size_t c = 0; c < 6; ++c) {
        const __m256 value = _mm256_set1_ps(boxes.at.data()[c].data()[box]);
        s.left[c] = _mm256_min_ps(s.left[c], _mm256_blendv_ps(none, value, goes_left));
        s.right[c] = _mm256_min_ps(s.right[c], _mm256_blendv_ps(value, none, goes_left));
    }
    s.left_count = _mm256_add_ps(s.left_count, _mm256_and_ps(_mm256_set1_ps(1.0f), goes_left));
}
RAYDIX_AVX2 RAYDIX_INLINE __m256 area_8(const __m256* box) {
    const __m256 x = _mm256_add_ps(box[0], box[3]), y = _mm256_add_ps(box[1], box[4]),
                 z = _mm256_add_ps(box[2], box[5]);
    return _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(x, y), _mm256_mul_ps(y, z)),
                         _mm256_mul_ps(z, x));
}
RAYDIX_AVX2 RAYDIX_INLINE std::array<float, 8> cost_8(const Sides8& s, int count) {
    const __m256 right_count =
        _mm256_sub_ps(_mm256_set1_ps(static_cast<float>(count)), s.left_count);
    std::array<float, 8> cost;
    _mm256_storeu_ps(cost.data(), _mm256_add_ps(_mm256_mul_ps(area_8(s.left), s.left_count),
                                                _mm256_mul_ps(area_8(s.right), right_count)));
    return cost;
}

RAYDIX_AVX2 Found best_of_few_8(const SmallBoxes& boxes, LaneSet set, LaneSet valid) {
    const __m256i bit_of_lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    Found found;
    for (LaneSet first = 0; first < small_boxes && valid >> first != 0; first += 8) {
        Sides8 sides;
        begin_8(sides);
        std::size_t k = 0;
        for (LaneSet rest = set; rest != 0; rest &= rest - 1, ++k) {
            const bool last = (rest & (rest - 1)) == 0;
            const LaneSet bits = last ? 0 : lanes_with_bit.data()[k] >> first;
            const __m256i mine =
                _mm256_and_si256(_mm256_set1_epi32(static_cast<int>(bits)), bit_of_lane);
            add_8(sides, boxes, static_cast<std::size_t>(std::countr_zero(rest)),
                  _mm256_castsi256_ps(_mm256_cmpeq_epi32(mine, bit_of_lane)));
        }
        take(found, cost_8(sides, std::popcount(set)), 0, first, valid);
    }
    return found;
}

RAYDIX_AVX2 Found best_plane_8(const SmallBoxes& boxes, LaneSet set) {
    Found found;
    for (std::size_t axis = 0; axis < 3; ++axis)
        for (LaneSet first = 0; first < small_boxes; first += 8) {
            if ((set >> first & 255) == 0) continue;
            const float* centers = boxes.at.data()[6 + axis].data();
            const __m256 plane = _mm256_load_ps(centers + first);
            Sides8 sides;
            begin_8(sides);
            for (LaneSet rest = set; rest != 0; rest &= rest - 1) {
                const auto box = static_cast<std::size_t>(std::countr_zero(rest));
                add_8(sides, boxes, box,
                      _mm256_cmp_ps(_mm256_set1_ps(centers[box]), plane, _CMP_LE_OQ));
            }
            take(found, cost_8(sides, std::popcount(set)), axis, first, set);
        }
    return found;
}

struct Sides16 {
    __m512 left[6], right[6], left_count;
};
RAYDIX_AVX512 RAYDIX_INLINE void begin_16(Sides16& s) {
    for (int c = 0; c < 6; ++c) s.left[c] = s.right[c] = _mm512_set1_ps(infinity);
    s.left_count = _mm512_setzero_ps();
}
RAYDIX_AVX512 RAYDIX_INLINE void add_16(Sides16& s, const SmallBoxes& boxes, std::size_t box,
                                        __mmask16 goes_left) {
    const auto goes_right = static_cast<__mmask16>(~goes_left);
    for (std::size_t c = 0; c < 6; ++c) {
        const __m512 value = _mm512_set1_ps(boxes.at.data()[c].data()[box]);
        s.left[c] = _mm512_mask_min_ps(s.left[c], goes_left, s.left[c], value);
        s.right[c] = _mm512_mask_min_ps(s.right[c], goes_right, s.right[c], value);
    }
    s.left_count = _mm512_mask_add_ps(s.left_count, goes_left, s.left_count, _mm512_set1_ps(1.0f));
}
RAYDIX_AVX512 RAYDIX_INLINE __m512 area_16(const __m512* box) {
    const __m512 x = _mm512_add_ps(box[0], box[3]), y = _mm512_add_ps(box[1], box[4]),
                 z = _mm512_add_ps(box[2], box[5]);
    return _mm512_add_ps(_mm512_add_ps(_mm512_mul_ps(x, y), _mm512_mul_ps(y, z)),
                         _mm512_mul_ps(z, x));
}
RAYDIX_AVX512 RAYDIX_INLINE __m512 cost_16(const Sides16& s, int count) {
    const __m512 right_count =
        _mm512_sub_ps(_mm512_set1_ps(static_cast<float>(count)), s.left_count);
    return _mm512_add_ps(_mm512_mul_ps(area_16(s.left), s.left_count),
                         _mm512_mul_ps(area_16(s.right), right_count));
}
/// Lanes that are not valid, or NaN, become infinite.
RAYDIX_AVX512 RAYDIX_INLINE __m512 only_16(__m512 cost, LaneSet valid) {
    const __m512 none = _mm512_set1_ps(infinity);
    return _mm512_min_ps(_mm512_mask_mov_ps(none, static_cast<__mmask16>(valid), cost), none);
}

RAYDIX_AVX512 LaneSet up_to_16(const std::array<float, small_boxes>& center2, LaneSet set,
                               LaneSet lane) {
    return set &
           static_cast<LaneSet>(_mm512_cmp_ps_mask(
               _mm512_load_ps(center2.data()), _mm512_set1_ps(center2.data()[lane]), _CMP_LE_OQ));
}

RAYDIX_AVX512 Found best_of_few_16(const SmallBoxes& boxes, LaneSet set, LaneSet valid) {
    Sides16 sides;
    begin_16(sides);
    std::size_t k = 0;
    for (LaneSet rest = set; rest != 0; rest &= rest - 1, ++k) {
        const bool last = (rest & (rest - 1)) == 0;
        add_16(sides, boxes, static_cast<std::size_t>(std::countr_zero(rest)),
               static_cast<__mmask16>(last ? 0 : lanes_with_bit.data()[k]));
    }
    const __m512 cost = only_16(cost_16(sides, std::popcount(set)), valid);
    const float least = _mm512_reduce_min_ps(cost);
    const auto lanes =
        static_cast<LaneSet>(_mm512_cmp_ps_mask(cost, _mm512_set1_ps(least), _CMP_EQ_OQ));
    return {least, 0, static_cast<LaneSet>(std::countr_zero(lanes))};
}

RAYDIX_AVX512 Found best_plane_16(const SmallBoxes& boxes, LaneSet set) {
    __m512 costs[3];
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const float* centers = boxes.at.data()[6 + axis].data();
        const __m512 plane = _mm512_load_ps(centers);
        Sides16 sides;
        begin_16(sides);
        for (LaneSet rest = set; rest != 0; rest &= rest - 1) {
            const auto box = static_cast<std::size_t>(std::countr_zero(rest));
            add_16(sides, boxes, box,
                   _mm512_cmp_ps_mask(_mm512_set1_ps(centers[box]), plane, _CMP_LE_OQ));
        }
        costs[axis] = only_16(cost_16(sides, std::popcount(set)), set);
    }
    const float least =
        _mm512_reduce_min_ps(_mm512_min_ps(_mm512_min_ps(costs[0], costs[1]), costs[2]));
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto lanes = static_cast<LaneSet>(
            _mm512_cmp_ps_mask(costs[axis], _mm512_set1_ps(least), _CMP_EQ_OQ));
        if (lanes != 0) return {least, axis, static_cast<LaneSet>(std::countr_zero(lanes))};
    }
    return {};
}

#endif

Found best_of_few(const SmallBoxes& boxes, LaneSet set, int count, [[maybe_unused]] int width) {
    const LaneSet valid = (1u << (1u << (count - 1))) - 2;  // not the empty set
#if defined(RAYDIX_WITH_WIDE_LANES)
    if (width == 16) return best_of_few_16(boxes, set, valid);
    if (width == 8) return best_of_few_8(boxes, set, valid);
#endif
    return best_of_few_4(boxes, set, valid);
}

Found best_plane(const SmallBoxes& boxes, LaneSet set, [[maybe_unused]] int width) {
#if defined(RAYDIX_WITH_WIDE_LANES)
    if (width == 16) return best_plane_16(boxes, set);
    if (width == 8) return best_plane_8(boxes, set);
#endif
    return best_plane_4(boxes, set);
}

}  // namespace

LaneSet split_small(const SmallBoxes& boxes, LaneSet set, int width) {
    const int count = std::popcount(set);
    const bool few = count <= few_boxes;
    const Found found = few ? best_of_few(boxes, set, count, width) : best_plane(boxes, set, width);
    if (found.cost == 0 || found.cost == infinity) return lower_half(set);
    if (few) return spread_over(found.lane, set);
#if defined(RAYDIX_WITH_WIDE_LANES)
    if (width == 16) return up_to_16(boxes.at[6 + found.axis], set, found.lane);
#endif
    return up_to(boxes.at[6 + found.axis], set, found.lane);
}

int split_width() {
#if defined(RAYDIX_WITH_WIDE_LANES)
    static const int width = __builtin_cpu_supports("avx512f") ? 16
                             : __builtin_cpu_supports("avx2")  ? 8
                                                               : 4;
    return width;
#else
    return 4;
#endif
}

}  // namespace raydix
