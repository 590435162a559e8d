// A subtree of a SAH build that one thread makes: references -> nodes and leaf order, numbered from
// 0. What is small enough for a cache is copied there first.
#pragma once

#include <raydix/bvh.h>

#include <array>
#include <cstdint>
#include <vector>

#include "tree/sah_reference.h"
#include "tree/spatial_split.h"
#include "tree/sweep_split.h"

namespace raydix {

/// Deeper nodes are divided in the middle of their list, so that no stack overflows.
inline constexpr std::uint32_t deepest_sah_split = 96;

/// Spatial splits of a build, if there are any.
struct SpatialRules {
    const ReferenceCutter* cutter = nullptr;  // null: none
    float least_overlap = 0;                  // half surface of the boxes' intersection
};

/// The spatial split of a node if it is better than `object` and costs no more than `spare` new
/// references. `order`: all references of the node by centroid on the axis of `object`.
[[nodiscard]] bool choose_spatial_split(const SpatialRules& rules, const SahReference* references,
                                        std::span<const std::uint32_t> order,
                                        const SweepSplit& object, std::uint32_t spare,
                                        SpatialSides& sides);

/// New references that one side of a node may still make, of those left to both.
[[nodiscard]] constexpr std::uint32_t share_of(std::uint32_t spare, std::uint32_t own,
                                               std::uint32_t all) {
    return static_cast<std::uint32_t>(std::uint64_t{spare} * own / all);
}

/// What a subtree came to.
struct SubtreeSum {
    std::uint32_t inner = 0, references = 0, height = 0;
    float cost = 0;  // SAH times the root's area
};

/// Where a subtree goes: pairs of children from `nodes` on, in preorder; links count from 0, pair r
/// at 2 r, and places of the order from 0.
struct SubtreeOut {
    BvhNode* nodes;        // [2 * (references + spare - 1)]
    std::uint32_t* order;  // [references + spare]
};

class SubtreeBuild {
public:
    SubtreeBuild(std::uint32_t max_leaf, const SpatialRules& rules)
        : max_leaf_(max_leaf), rules_(rules) {}

    /// Makes at most `spare` new references. `lists`: the orders name places in lists.references.
    /// `local` [lists.references] is scratch of all tasks together: each uses the places of its own
    /// references.
    SubtreeSum run(const SweepLists& lists, std::uint32_t spare, std::uint32_t depth,
                   std::uint32_t* local, const SubtreeOut& out, BvhNode& root);

private:
    /// A node's places in the orders.
    struct Range {
        std::uint32_t begin, end, depth, spare;

        [[nodiscard]] std::uint32_t count() const { return end - begin; }
    };
    /// The left child comes first, so it stands above the right one: its subtree may need more
    /// places than it has.
    struct Children {
        Range left, right;
    };
    struct Below {
        float cost;
        std::uint32_t height;
    };

    void copy_in(const SweepLists& lists, std::uint32_t spare, std::uint32_t* local);
    Below build(const Range& range, BvhNode& node);
    Below leaf(const Range& range, BvhNode& node);
    Children divide(const Range& range);
    Children divide_by_order(const Range& range, const SweepSplit& split);
    /// As spatial_ says, which is about the order of one axis.
    Children divide_by_plane(const Range& range, std::uint32_t axis_of_sides);
    /// Marks the left child's references; true if they are the upper ones.
    bool mark_left(const Range& range, const SweepSplit& split);
    [[nodiscard]] static Children children_of(const Range& range, std::uint32_t left,
                                              std::uint32_t right);
    [[nodiscard]] std::span<const std::uint32_t> order_of(const Range& range,
                                                          std::uint32_t axis) const {
        return {orders_[axis].data() + range.begin, range.count()};
    }
    /// What the order lists from `begin` on, at most 255, ascending and each once; returns how
    /// many.
    std::uint32_t distinct_ids(std::uint32_t begin, std::uint32_t* ids) const;

    std::uint32_t max_leaf_;
    SpatialRules rules_;
    SubtreeOut out_{};
    std::uint32_t pairs_ = 0, listed_ = 0, places_ = 0;
    std::vector<SahReference> references_;
    std::array<std::vector<std::uint32_t>, 3> orders_;
    std::vector<std::uint32_t> spare_;
    std::vector<float> areas_;
    std::vector<std::uint8_t> sides_;  // of places
    SpatialSides spatial_;
    SideLists side_lists_;
};

}  // namespace raydix
