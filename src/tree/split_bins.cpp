#include "tree/split_bins.h"

#include <algorithm>

#include "base/math.h"

namespace raydix {
namespace {

/// Shorter extents of doubled centroids are not divided: the scale would overflow.
constexpr float least_extent = 1e-30f;
/// The last centroid falls below the upper end of the last bin.
constexpr float below_one = 0.99999f;

/// What fell into the bins of the three axes.
class Bins {
public:
    explicit Bins(std::uint32_t bins) : bins_(bins) {
        for (std::uint32_t b = 0; b < bins; ++b) {
            for (std::size_t axis = 0; axis < 3; ++axis) at_[b][axis] = Corners{};
            boxes_[b] = primitives_[b] = {};
        }
    }

    void fill(std::span<const SplitBox> boxes, const BinGrid& grid) {
        const Float4 origin = Float4::load(grid.origin.data());
        const Float4 scale = Float4::load(grid.scale.data());
        for (const SplitBox& box : boxes) {
            std::array<std::int32_t, 4> bin;
            ((box.center2() - origin) * scale).store_whole(bin.data());
            const Float4 lo = Float4::load(&box.lo.x), hi = Float4::load(&box.minus_hi.x);
            for (std::size_t axis = 0; axis < 3; ++axis) {
                const auto b = static_cast<std::size_t>(bin[axis]);
                Corners& corners = at_[b][axis];
                corners.lo = min_of(corners.lo, lo);
                corners.hi = min_of(corners.hi, hi);
                ++boxes_[b][axis];
                primitives_[b][axis] += box.count;
            }
        }
    }

    [[nodiscard]] std::optional<Split> best() const {
        const Best found = sweep();
        std::size_t axis = 0;
        for (std::size_t a = 1; a < 3; ++a)
            if (found.cost[a] < found.cost[axis]) axis = a;
        if (found.cost[axis] == infinity) return std::nullopt;
        if (found.cost[axis] == 0) return most_even();
        return split_at(axis, static_cast<std::uint32_t>(found.bin[axis]));
    }

private:
    struct Corners {
        Float4 lo = Float4::all(infinity), hi = Float4::all(infinity);

        void add(const Corners& other) {
            lo = min_of(lo, other.lo);
            hi = min_of(hi, other.hi);
        }
    };
    using PerAxis = std::array<std::uint32_t, 4>;
    struct Best {
        std::array<float, 4> cost, bin;
    };

    /// Boxes and counts of the bins on one side of a plane, for three planes at once: one per axis.
    struct Side {
        std::array<Corners, 3> corners;
        PerAxis primitives{};

        void add(const std::array<Corners, 3>& bin, const PerAxis& count) {
            for (std::size_t axis = 0; axis < 3; ++axis) corners[axis].add(bin[axis]);
            for (std::size_t axis = 0; axis < 4; ++axis) primitives[axis] += count[axis];
        }
        /// Area times count in the lane of each axis; NaN if nothing is on this side.
        [[nodiscard]] Float4 cost() const {
            Float4 x = corners[0].hi + corners[0].lo, y = corners[1].hi + corners[1].lo,
                   z = corners[2].hi + corners[2].lo, none = Float4::all(0);
            transpose(x, y, z, none);
            return ((x * y + y * z) + z * x) * Float4::of(primitives.data());
        }
    };

    [[nodiscard]] Best sweep() const {
        std::array<Float4, max_bins> right_cost;
        Side right, left;
        for (std::uint32_t b = bins_ - 1; b > 0; --b) {
            right.add(at_[b], primitives_[b]);
            right_cost[b] = right.cost();
        }
        Float4 cost = Float4::all(infinity), bin = Float4::all(0);
        for (std::uint32_t b = 0; b + 1 < bins_; ++b) {
            left.add(at_[b], primitives_[b]);
            const Float4 here = left.cost() + right_cost[b + 1];
            const Mask4 better = here < cost;  // no for NaN
            cost = select(better, here, cost);
            bin = select(better, Float4::all(static_cast<float>(b)), bin);
        }
        Best best;
        cost.store(best.cost.data());
        bin.store(best.bin.data());
        return best;
    }

    [[nodiscard]] Split most_even() const {
        Split best{};
        std::uint32_t best_larger = ~0u;
        for (std::size_t axis = 0; axis < 3; ++axis)
            for (std::uint32_t b = 0; b + 1 < bins_; ++b) {
                const Split split = split_at(axis, b);
                const std::uint32_t right =
                    split_at(axis, bins_ - 1).left_primitives - split.left_primitives;
                const std::uint32_t larger = std::max(split.left_primitives, right);
                if (split.left_primitives == 0 || right == 0 || larger >= best_larger) continue;
                best_larger = larger;
                best = split;
            }
        return best;
    }

    [[nodiscard]] Split split_at(std::size_t axis, std::uint32_t last_left) const {
        Split split{axis, static_cast<std::int32_t>(last_left), 0, 0};
        for (std::uint32_t b = 0; b <= last_left; ++b) {
            split.left_boxes += boxes_[b][axis];
            split.left_primitives += primitives_[b][axis];
        }
        return split;
    }

    std::uint32_t bins_;
    std::array<std::array<Corners, 3>, max_bins> at_;
    std::array<PerAxis, max_bins> boxes_, primitives_;
};

}  // namespace

BinGrid::BinGrid(std::span<const SplitBox> boxes) : bins(bin_count(boxes.size())) {
    Float4 lo = Float4::all(infinity), hi = Float4::all(-infinity);
    for (const SplitBox& box : boxes) {
        const Float4 center2 = box.center2();
        lo = min_of(lo, center2);
        hi = max_of(hi, center2);
    }
    std::array<float, 4> extent;
    lo.store(origin.data());
    (hi - lo).store(extent.data());
    for (std::size_t axis = 0; axis < 4; ++axis)
        scale[axis] = extent[axis] >= least_extent
                          ? below_one * static_cast<float>(bins) / extent[axis]
                          : 0.0f;
}

std::optional<Split> find_split(std::span<const SplitBox> boxes, const BinGrid& grid) {
    if (grid.flat()) return std::nullopt;
    Bins bins(grid.bins);
    bins.fill(boxes, grid);
    return bins.best();
}

void divide_boxes(std::span<const SplitBox> from, const BinGrid& grid, const Split& split,
                  SplitBox* to) {
    // Stores to both cursors' places without a branch: nobody can guess the side.
    std::size_t left = 0, right = split.left_boxes;
    for (const SplitBox& box : from) {
        const bool goes_left = grid.bin(box, split.axis) <= split.last_left;
        to[goes_left ? left : right] = box;
        left += goes_left;
        right += !goes_left;
    }
}

}  // namespace raydix
