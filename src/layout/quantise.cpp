#include "layout/quantise.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#define RAYDIX_INLINE __attribute__((always_inline)) inline
#if defined(__x86_64__)
#define RAYDIX_WITH_AVX2
#endif

namespace raydix {
namespace {

/// b - a without rounding: `value` is the nearest double, `rest` what it lacks (Knuth's two-sum;
/// two floats can be 2^149 apart in size).
struct ExactDifference {
    double value, rest;
    ExactDifference(double a, double b) : value(b - a) {
        const double b_part = value + a, a_part = b_part - value;
        rest = (b - b_part) - (a - a_part);
    }
    /// Whether the difference is at least / at most x. x and `value` are doubles, hence the rest
    /// matters only if they are equal.
    [[nodiscard]] bool at_least(double x) const { return value > x || (value == x && rest >= 0); }
    [[nodiscard]] bool at_most(double x) const { return value < x || (value == x && rest <= 0); }
};

struct QuantisedAxis {
    bool contained;
    std::uint8_t lo[quantised_width], hi[quantised_width];
};

/// Four at a time, by the compilers' own vectors: the loop below is a fifth of what making a layout
/// costs, and no compiler makes vectors of it by itself.
constexpr int lanes = 4;
using Floats = float __attribute__((vector_size(lanes * sizeof(float))));
using Ints = std::int32_t __attribute__((vector_size(lanes * sizeof(std::int32_t))));
using Doubles = double __attribute__((vector_size(lanes * sizeof(double))));
using Bytes = std::uint8_t __attribute__((vector_size(lanes)));
using Masks = std::int64_t __attribute__((vector_size(lanes * sizeof(std::int64_t))));

RAYDIX_INLINE void store_bytes(const Doubles& values, std::uint8_t* out) {
    const Ints whole = __builtin_convertvector(values, Ints);
    const Bytes bytes = __builtin_convertvector(whole, Bytes);
    std::memcpy(out, &bytes, sizeof(bytes));
}

/// Distances from an origin, in steps; `rest` is what they lack (see ExactDifference).
struct Steps {
    Doubles x, rest, whole;

    RAYDIX_INLINE Steps(float origin, const float* at, double per_step) {
        Floats loaded;
        std::memcpy(&loaded, at, sizeof(loaded));
        const Doubles b = __builtin_convertvector(loaded, Doubles), a = Doubles{} + double(origin);
        const Doubles value = b - a, b_part = value + a, a_part = b_part - value;
        rest = (b - b_part) - (a - a_part);
        x = value * per_step;
        whole = __builtin_convertvector(__builtin_convertvector(x, Ints), Doubles);
    }
};

/// Of eight children at once: the largest steps at or below lo, the least at or above hi.
RAYDIX_INLINE QuantisedAxis quantise_axis(float origin, int exponent, const float* lo,
                                          const float* hi) {
    const double per_step = quantised_step(254 - exponent);  // exact, as is multiplying by it
    const Doubles zero{}, one = zero + 1.0, most = zero + double(max_steps);
    QuantisedAxis out;
    Masks contained = zero == zero;
    for (int s = 0; s < quantised_width; s += lanes) {
        const Steps below(origin, lo + s, per_step), above(origin, hi + s, per_step);
        Doubles a = below.whole;
        a -= ((a == below.x) & (below.rest < zero)) ? one : zero;
        a = a < zero ? zero : a;
        Doubles b = above.whole;
        b += ((b < above.x) | ((b == above.x) & (above.rest > zero))) ? one : zero;
        b = b > most ? most : b;
        contained &= ((a < below.x) | ((a == below.x) & (below.rest >= zero))) &
                     ((b > above.x) | ((b == above.x) & (above.rest <= zero)));
        store_bytes(a, out.lo + s);
        store_bytes(b, out.hi + s);
    }
    out.contained = (contained[0] & contained[1] & contained[2] & contained[3]) != 0;
    return out;
}

RAYDIX_INLINE QuantisedBoxes quantise_here(const SlotBoxes& boxes, const Aabb& all) {
    QuantisedBoxes out;
    for (int axis = 0; axis < 3; ++axis) {
        const float origin = coordinate(all.lo, axis);
        float lo[quantised_width], hi[quantised_width];
        for (int s = 0; s < quantised_width; ++s) {
            const bool used = (boxes.used >> s & 1) != 0;
            lo[s] = used ? boxes.lo[axis][s] : origin;
            hi[s] = used ? boxes.hi[axis][s] : origin;
        }
        int exponent = step_exponent(origin, coordinate(all.hi, axis));
        QuantisedAxis q = quantise_axis(origin, exponent, lo, hi);
        while (!q.contained && exponent < max_step_exponent)
            q = quantise_axis(origin, ++exponent, lo, hi);
        out.origin[axis] = origin;
        out.exponent[axis] = static_cast<std::uint8_t>(exponent);
        for (int s = 0; s < quantised_width; ++s) {
            const bool used = (boxes.used >> s & 1) != 0;
            out.lo[axis][s] = used ? q.lo[s] : static_cast<std::uint8_t>(max_steps);
            out.hi[axis][s] = used ? q.hi[s] : std::uint8_t{0};
        }
    }
    return out;
}

#if defined(RAYDIX_WITH_AVX2)
__attribute__((target("avx2"))) QuantisedBoxes quantise_avx2(const SlotBoxes& boxes,
                                                             const Aabb& all) {
    return quantise_here(boxes, all);
}
#endif

}  // namespace

double quantised_step(int exponent) {
    return std::bit_cast<double>(static_cast<std::uint64_t>(exponent - 127 + 1023) << 52);
}

QuantisedBoxes quantise(const SlotBoxes& boxes, const Aabb& all) {
#if defined(RAYDIX_WITH_AVX2)
    static const bool avx2 = __builtin_cpu_supports("avx2") != 0;
    if (avx2) return quantise_avx2(boxes, all);
#endif
    return quantise_here(boxes, all);
}

int step_exponent(float lo, float hi) {
    const ExactDifference extent(lo, hi);
    if (extent.at_most(0.0)) return min_step_exponent;
    const auto bits = std::bit_cast<std::uint64_t>(extent.value / max_steps);
    const int exponent = static_cast<int>(bits >> 52) - 1023;  // 2^exponent is at most that
    int biased = std::clamp(exponent - 1 + 127, min_step_exponent, max_step_exponent);
    while (!extent.at_most(max_steps * quantised_step(biased))) ++biased;
    return biased;
}

bool is_at_most(float origin, int exponent, int q, float at) {
    return ExactDifference(origin, at).at_least(q * quantised_step(exponent));
}

bool is_at_least(float origin, int exponent, int q, float at) {
    return ExactDifference(origin, at).at_most(q * quantised_step(exponent));
}

void assign_octant_slots(std::span<const Aabb> children, int* slots) {
    const int count = static_cast<int>(children.size());
    Aabb all = empty_box();
    for (const Aabb& box : children) all = unite(all, box);
    const Vec3 middle = center_of(all);
    std::array<std::array<float, quantised_width>, quantised_width> gain{};
    for (int k = 0; k < count; ++k) {
        const Vec3 d = center_of(children[static_cast<std::size_t>(k)]) - middle;
        for (int s = 0; s < quantised_width; ++s)
            gain[static_cast<std::size_t>(k)][static_cast<std::size_t>(s)] =
                ((s & 1 ? d.x : -d.x) + (s & 2 ? d.y : -d.y)) + (s & 4 ? d.z : -d.z);
    }
    // best[set]: the largest sum with the first |set| children in the slots of `set`.
    constexpr std::size_t sets = 1 << quantised_width;
    std::array<float, sets> best;
    std::array<std::uint8_t, sets> last{};  // the slot of the last of them
    best.fill(-infinity);
    best[0] = 0.0f;
    std::size_t best_set = 0;
    for (std::size_t set = 1; set < sets; ++set) {
        const int placed = std::popcount(set);
        if (placed > count) continue;
        for (std::size_t s = 0; s < quantised_width; ++s) {
            if ((set >> s & 1) == 0) continue;
            const float sum =
                best[set ^ std::size_t{1} << s] + gain[static_cast<std::size_t>(placed - 1)][s];
            if (sum > best[set] || best[set] == -infinity) {
                best[set] = sum;
                last[set] = static_cast<std::uint8_t>(s);
            }
        }
        if (placed == count && (std::popcount(best_set) != count || best[set] > best[best_set]))
            best_set = set;
    }
    for (int k = count - 1; k >= 0; --k) {
        slots[k] = last[best_set];
        best_set ^= std::size_t{1} << slots[k];
    }
}

}  // namespace raydix
