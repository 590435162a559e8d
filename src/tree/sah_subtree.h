// A subtree of a SAH build that one thread makes: references -> nodes and leaf order, numbered from
// 0. What is small enough for a cache is copied there first.
#pragma once

#include <raydix/bvh.h>

#include <array>
#include <cstdint>
#include <vector>

#include "tree/sah_reference.h"
#include "tree/sweep_split.h"

namespace raydix {

/// Deeper nodes are divided in the middle of their list, so that no stack overflows.
inline constexpr std::uint32_t deepest_sah_split = 96;

/// What a subtree came to.
struct SubtreeSum {
    std::uint32_t inner = 0, references = 0, height = 0;
    float cost = 0;  // SAH times the root's area
};

/// Where a subtree goes: pairs of children from `nodes` on, in preorder; links count from 0, pair r
/// at 2 r, and places of the order from 0.
struct SubtreeOut {
    BvhNode* nodes;        // [2 * (references - 1)]
    std::uint32_t* order;  // [references]
};

class SubtreeBuild {
public:
    explicit SubtreeBuild(std::uint32_t max_leaf) : max_leaf_(max_leaf) {}

    /// `lists`: the orders name places in lists.references. `local` [lists.references] is scratch
    /// of all tasks together: each uses the places of its own references.
    SubtreeSum run(const SweepLists& lists, std::uint32_t depth, std::uint32_t* local,
                   const SubtreeOut& out, BvhNode& root);

private:
    struct Range {
        std::uint32_t begin, end, depth;
    };
    struct Below {
        float cost;
        std::uint32_t height;
    };

    void copy_in(const SweepLists& lists, std::uint32_t* local);
    Below build(const Range& range, BvhNode& node);
    Below leaf(const Range& range, BvhNode& node);
    /// Divides the lists; returns the first place of the upper side.
    std::uint32_t divide(const Range& range);
    void partition(const Range& range, std::uint32_t axis, std::uint32_t middle);
    [[nodiscard]] bool upper_is_left(const Range& range, std::uint32_t middle) const;
    /// Ids at [begin, end) of the order, sorted, each once; returns how many.
    std::uint32_t distinct_ids(std::uint32_t begin);

    std::uint32_t max_leaf_;
    SubtreeOut out_{};
    std::uint32_t pairs_ = 0, listed_ = 0;
    std::vector<SahReference> references_;
    std::array<std::vector<std::uint32_t>, 3> orders_;
    std::vector<std::uint32_t> spare_;
    std::vector<float> areas_;
    std::vector<std::uint8_t> sides_;
};

}  // namespace raydix
