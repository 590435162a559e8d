#include "layout/quantise.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

namespace raydix {
namespace {

double step_of(int exponent) { return std::ldexp(1.0, exponent - 127); }

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

}  // namespace

int step_exponent(float lo, float hi) {
    const ExactDifference extent(lo, hi);
    if (extent.at_most(0.0)) return min_step_exponent;
    int exponent;
    std::frexp(extent.value / max_steps, &exponent);  // at most 2^exponent
    int biased = std::clamp(exponent - 2 + 127, min_step_exponent, max_step_exponent);
    while (!extent.at_most(max_steps * step_of(biased))) ++biased;
    return biased;
}

int steps_below(float origin, int exponent, float at) {
    const ExactDifference distance(origin, at);
    const double step = step_of(exponent);
    int q = static_cast<int>(std::clamp(distance.value / step, 0.0, double(max_steps)));
    while (q < max_steps && distance.at_least((q + 1) * step)) ++q;
    while (q > 0 && !distance.at_least(q * step)) --q;
    return q;
}

int steps_above(float origin, int exponent, float at) {
    const ExactDifference distance(origin, at);
    const double step = step_of(exponent);
    int q = static_cast<int>(std::clamp(distance.value / step, 0.0, double(max_steps)));
    while (q > 0 && distance.at_most((q - 1) * step)) --q;
    while (q < max_steps && !distance.at_most(q * step)) ++q;
    return q;
}

bool is_at_most(float origin, int exponent, int q, float at) {
    return ExactDifference(origin, at).at_least(q * step_of(exponent));
}

bool is_at_least(float origin, int exponent, int q, float at) {
    return ExactDifference(origin, at).at_most(q * step_of(exponent));
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

void assign_octant_slots_greedily(std::span<const Aabb> children, int* slots) {
    const std::size_t count = children.size();
    Aabb all = empty_box();
    for (const Aabb& box : children) all = unite(all, box);
    const Vec3 middle = center_of(all);
    std::array<Vec3, quantised_width> away;
    std::array<float, quantised_width> most;  // what the best slot would give
    for (std::size_t k = 0; k < count; ++k) {
        const Vec3 d = center_of(children[k]) - middle;
        away[k] = d;
        most[k] = (std::fabs(d.x) + std::fabs(d.y)) + std::fabs(d.z);
    }
    unsigned open = (1u << quantised_width) - 1;
    for (std::size_t turn = 0; turn < count; ++turn) {
        std::size_t next = 0;
        for (std::size_t k = 1; k < count; ++k)
            if (most[k] > most[next]) next = k;
        most[next] = -1.0f;
        const Vec3 d = away[next];
        float best = -infinity;
        for (unsigned left = open; left != 0; left &= left - 1) {
            const int s = std::countr_zero(left);
            const float gain = ((s & 1 ? d.x : -d.x) + (s & 2 ? d.y : -d.y)) + (s & 4 ? d.z : -d.z);
            if (gain > best || best == -infinity) {
                best = gain;
                slots[next] = s;
            }
        }
        open &= ~(1u << slots[next]);
    }
}

}  // namespace raydix
