// The points of one bottom node -> groups of 16: halved at the median of the widest side until 16
// are left. All loops are over plain arrays and free of branches that depend on the data.
#pragma once

#include <hwy/highway.h>

#include <algorithm>
#include <cstdint>
#include <limits>

#include "points/point_tree.h"

namespace raydix {

namespace hn = hwy::HWY_NAMESPACE;  // of the instruction set that all processors have

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

/// Of n >= 16 values; NaN among them is passed over, unless it is the first.
template <class T>
HWY_ATTR Interval<T> interval_of(const T* values, std::uint32_t n) {
    // Vectors by name: GCC turns loops over arrays of minima into conditional moves.
    const hn::CappedTag<T, 16> d;
    const auto lanes = static_cast<std::uint32_t>(hn::Lanes(d));
    auto lo = hn::Set(d, values[0]), hi = lo;
    const auto take = [&](std::uint32_t from) HWY_ATTR {
        const auto x = hn::LoadU(d, values + from);
        lo = hn::IfThenElse(hn::Lt(x, lo), x, lo);
        hi = hn::IfThenElse(hn::Gt(x, hi), x, hi);
    };
    std::uint32_t i = 0;
    for (; i + lanes <= n; i += lanes) take(i);
    if (i != n) take(n - lanes);  // some values a second time
    return {hn::GetLane(hn::MinOfLanes(d, lo)), hn::GetLane(hn::MaxOfLanes(d, hi))};
}

template <class T, int Dim>
class MedianSplitter {
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

    /// A number that `rank` of the first n keys, no two of which are equal, are below. Between two
    /// numbers whose ranks are known the next one is where keys spread evenly would have it, or,
    /// every other time, in the middle, so that any keys need few steps.
    [[nodiscard]] std::int32_t key_of_rank(std::uint32_t n, std::uint32_t rank) const {
        std::int64_t low = 0, high = std::int64_t{1} << 31;  // ranks: below `rank`, above it
        std::int64_t low_rank = 0, high_rank = n;
        for (bool even = true;; even = !even) {
            const std::int64_t middle =
                even ? low + (high - low) * (rank - low_rank) / (high_rank - low_rank)
                     : low + (high - low) / 2;
            const std::uint32_t below = count_below(n, static_cast<std::int32_t>(middle));
            if (below == rank) return static_cast<std::int32_t>(middle);
            if (below < rank) {
                low = middle + 1;
                low_rank = below;
            } else {
                high = middle;
                high_rank = below;
            }
        }
    }
    [[nodiscard]] std::uint32_t count_below(std::uint32_t n, std::int32_t key) const {
        std::int32_t below = 0;
        for (std::uint32_t i = 0; i < n; ++i) below += keys_[i] < key;
        return static_cast<std::uint32_t>(below);
    }

    PointRun<T, Dim> spare_;
    alignas(64) std::int32_t keys_[points_per_bottom];
    PointLeaf<T, Dim>* leaves_ = nullptr;
};

}  // namespace raydix
