// The points of one bottom node -> groups of 16: halved at the median of the widest side until 16
// are left. All loops are over plain arrays and free of branches that depend on the data.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "points/point_tree.h"

namespace raydix {

inline constexpr std::uint32_t points_per_bottom = points_per_leaf * boxes_per_node;

/// Up to 256 points by coordinate.
template <class T, int Dim>
struct PointRun {
    alignas(64) T at[Dim][points_per_bottom];
    alignas(64) std::uint32_t id[points_per_bottom];
};

template <class T>
struct Interval {
    T lo, hi;
};

/// Of n > 0 values, none of them NaN.
template <class T>
Interval<T> interval_of(const T* values, std::uint32_t n) {
    constexpr std::uint32_t lanes = 8;  // independent, so that they become vectors
    T lo[lanes], hi[lanes];
    for (std::uint32_t k = 0; k < lanes; ++k) lo[k] = hi[k] = values[0];
    std::uint32_t i = 0;
    for (; i + lanes <= n; i += lanes)
        for (std::uint32_t k = 0; k < lanes; ++k) {
            const T x = values[i + k];
            lo[k] = x < lo[k] ? x : lo[k];
            hi[k] = x > hi[k] ? x : hi[k];
        }
    for (; i < n; ++i) {
        lo[0] = std::min(lo[0], values[i]);
        hi[0] = std::max(hi[0], values[i]);
    }
    return {*std::min_element(lo, lo + lanes), *std::max_element(hi, hi + lanes)};
}

template <class T, int Dim>
class Halver {
public:
    /// Writes the points to groups, ceil(n / 16) of them; the last one may have gaps at its end.
    /// `run` is lost.
    void run(PointRun<T, Dim>& run, std::uint32_t n, PointLeaf<T, Dim>* leaves) {
        leaves_ = leaves;
        part(run, spare_, 0, n);
    }

    static void write_leaf(const PointRun<T, Dim>& from, std::uint32_t begin, std::uint32_t n,
                           PointLeaf<T, Dim>& leaf) {
        for (int d = 0; d < Dim; ++d) {
            for (std::uint32_t i = 0; i < n; ++i) leaf.at[d][i] = from.at[d][begin + i];
            for (std::uint32_t i = n; i < points_per_leaf; ++i)
                leaf.at[d][i] = std::numeric_limits<T>::quiet_NaN();
        }
        for (std::uint32_t i = 0; i < n; ++i) leaf.id[i] = from.id[begin + i];
        for (std::uint32_t i = n; i < points_per_leaf; ++i) leaf.id[i] = no_primitive;
    }

private:
    void part(PointRun<T, Dim>& from, PointRun<T, Dim>& to, std::uint32_t begin, std::uint32_t n) {
        if (n <= points_per_leaf) return write_leaf(from, begin, n, *leaves_++);
        const std::uint32_t leaves = (n + points_per_leaf - 1) / points_per_leaf;
        const std::uint32_t left = (leaves + 1) / 2 * points_per_leaf;
        make_keys(from, begin, n);
        const std::int32_t first_right = key_of_rank(n, left);
        std::uint32_t next_left = begin, next_right = begin + left;
        for (std::uint32_t i = 0; i < n; ++i) {
            const std::uint32_t is_right = keys_[i] >= first_right;
            const std::uint32_t place = is_right != 0 ? next_right : next_left;
            next_right += is_right;
            next_left += 1 - is_right;
            for (int d = 0; d < Dim; ++d) to.at[d][place] = from.at[d][begin + i];
            to.id[place] = from.id[begin + i];
        }
        part(to, from, begin, left);
        part(to, from, begin + left, n - left);
    }

    /// Order along the widest side, in 2^23 steps of it; then the order they stand in.
    void make_keys(const PointRun<T, Dim>& from, std::uint32_t begin, std::uint32_t n) {
        const T* side = from.at[0] + begin;
        Interval<T> widest = interval_of(side, n);
        for (int d = 1; d < Dim; ++d) {
            const Interval<T> other = interval_of(from.at[d] + begin, n);
            if (other.hi - other.lo > widest.hi - widest.lo) {
                widest = other;
                side = from.at[d] + begin;
            }
        }
        constexpr T last = (1 << 23) - 1;
        const T size = widest.hi - widest.lo;
        const T scale = size > 0 ? std::min(last / size, std::numeric_limits<T>::max()) : T{0};
        for (std::uint32_t i = 0; i < n; ++i) {
            const T step = (side[i] - widest.lo) * scale;
            keys_[i] = static_cast<std::int32_t>(step < last ? step : last) << 8 |
                       static_cast<std::int32_t>(i);
        }
    }

    /// A number that `rank` of the first n keys, no two of which are equal, are below.
    [[nodiscard]] std::int32_t key_of_rank(std::uint32_t n, std::uint32_t rank) const {
        std::int64_t low = 0, high = std::int64_t{1} << 31;
        for (;;) {
            const auto middle = static_cast<std::int32_t>((low + high) / 2);
            std::int32_t below = 0;
            for (std::uint32_t i = 0; i < n; ++i) below += keys_[i] < middle;
            if (below == static_cast<std::int32_t>(rank)) return middle;
            if (below < static_cast<std::int32_t>(rank))
                low = std::int64_t{middle} + 1;
            else
                high = middle;
        }
    }

    PointRun<T, Dim> spare_;
    alignas(64) std::int32_t keys_[points_per_bottom];
    PointLeaf<T, Dim>* leaves_ = nullptr;
};

}  // namespace raydix
