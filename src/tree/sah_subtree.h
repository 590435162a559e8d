// A subtree of a SAH build that one thread makes: references -> nodes and leaf order, numbered from
// 0. What is small enough for a cache is copied there first.
#pragma once

#include <raydix/bvh.h>

#include <array>
#include <cstdint>
#include <vector>

#include "tree/sah_reference.h"
#include "tree/sah_top.h"
#include "tree/sweep_split.h"

namespace raydix {

/// Deeper nodes are divided in the middle of their list, so that no stack overflows.
inline constexpr std::uint32_t deepest_sah_split = 96;

class SubtreeBuild {
public:
    explicit SubtreeBuild(std::uint32_t max_leaf) : max_leaf_(max_leaf) {}

    /// `lists`: the orders name places in lists.references.
    /// `local` [lists.references] is scratch of all tasks together: each uses the places of its own
    /// references.
    SubtreeSum run(const SweepLists& lists, std::uint32_t depth, std::uint32_t* local,
                   const SubtreeOut& out, BvhNode& root);

private:
    /// A node's places in the orders.
    struct Range {
        std::uint32_t begin, end, depth;

        [[nodiscard]] std::uint32_t count() const { return end - begin; }
    };
    struct Children {
        Range left, right;
    };
    struct Below {
        float cost;
        std::uint32_t height;
    };

    void copy_in(const SweepLists& lists, std::uint32_t* local);
    Below build(const Range& range, BvhNode& node);
    Below leaf(const Range& range, BvhNode& node);
    Children divide(const Range& range);
    Children divide_by_order(const Range& range, const SweepSplit& split);
    /// Marks the left child's references; true if they are the upper ones.
    bool mark_left(const Range& range, const SweepSplit& split);
    [[nodiscard]] std::span<const std::uint32_t> order_of(const Range& range,
                                                          std::uint32_t axis) const {
        return {orders_[axis].data() + range.begin, range.count()};
    }
    /// What the order lists from `begin` on, at most 255, ascending and each once; returns how
    /// many.
    std::uint32_t distinct_ids(std::uint32_t begin, std::uint32_t* ids) const;

    std::uint32_t max_leaf_;
    SubtreeOut out_{};
    std::uint32_t pairs_ = 0, listed_ = 0;
    std::vector<SahReference> references_;
    std::array<std::vector<std::uint32_t>, 3> orders_;
    std::vector<std::uint32_t> spare_;
    std::vector<float> areas_;
    std::vector<std::uint8_t> sides_;  // of places
};

}  // namespace raydix
