// Nodes bottom-up, whole ones, a warp for each 32 keys: leaves climb by the slots of their parents
// (Karras 2012, section 4). Two children that end in one warp meet by shuffles; only those that
// reach over its edges meet in memory, where the second to arrive goes on. Each node is written
// once. Slots of parents + leaf boxes -> nodes with links and boxes, and the exact depth.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>

#include "base/atomic.h"
#include "base/hd.h"
#include "base/math.h"
#include "base/wide_store.h"
#include "exec/warp.h"
#include "exec/warp_boxes.h"
#include "tree/fit.h"
#include "tree/lbvh_launches.h"

namespace raydix {

/// Where nodes go, known before their boxes are.
struct ParentSlots {
    static constexpr std::uint32_t no_leaf = 0xFFFFFFFFu;

    std::uint32_t* of_leaf;          // [n]: the slot of the leaf that begins with a key, or no_leaf
    std::uint8_t* leaf_count;        // [n], where a leaf begins
    std::uint32_t* of_inner;         // [inner], 0 for the root
    const std::uint32_t* kept;       // [n]: inner nodes of lower index; null where all are kept
    std::uint8_t* meeting;           // [inner], 0 before; 1 + the height of the first to arrive
    const std::uint32_t* key_count;  // [1]
    const std::uint32_t* inner_count;  // [1]

    [[nodiscard]] RAYDIX_HD std::uint32_t kept_before(std::uint32_t node) const {
        return kept == nullptr ? node : kept[node];
    }
};

/// The subtrees that the lanes of a warp are done with; one whose first key is a lane's.
template <class Warp>
struct WarpSubtrees {
    template <class T>
    using Var = typename Warp::template Var<T>;

    Var<std::uint32_t> slot, last, height;
    Var<std::uint32_t> link, count;  // `first` and `count` of the node
    WarpBoxes<Warp> boxes;

    [[nodiscard]] RAYDIX_HD BvhNode node(std::uint32_t lane) const {
        const Aabb box = boxes.get(lane);
        return {box.lo, link[lane], box.hi, count[lane]};
    }
};

/// One warp's part.
template <class Warp, class LeafBox>
class WarpClimb {
public:
    template <class T>
    using Var = typename Warp::template Var<T>;

    RAYDIX_HD WarpClimb(const Warp& warp, const LeafBox& leaf_box, const ParentSlots& slots,
                        BvhNode* nodes, std::uint32_t* max_depth)
        : warp_(warp), leaf_box_(leaf_box), slots_(slots), nodes_(nodes), max_depth_(max_depth) {}

    RAYDIX_HD void run(std::uint32_t first_key) {
        first_key_ = first_key;
        load();
        while (join_children()) {
        }
        warp_.each([&](std::uint32_t lane) {
            if ((active_ >> lane & 1) != 0) climb(lane);
        });
    }

private:
    /// The leaves, and the slots of the inner nodes whose index is one of the warp's keys.
    RAYDIX_HD void load() {
        const std::uint32_t n = *slots_.key_count, inner = *slots_.inner_count;
        first_rank_ = slots_.kept_before(first_key_);
        active_ = warp_.ballot([&](std::uint32_t lane) {
            const std::uint32_t rank = first_rank_ + lane;
            inner_slot_[lane] = rank < inner ? slots_.of_inner[rank] : 0;
            const std::uint32_t key = first_key_ + lane;
            at_.slot[lane] = key < n ? slots_.of_leaf[key] : ParentSlots::no_leaf;
            return at_.slot[lane] != ParentSlots::no_leaf;
        });
        warp_.each([&](std::uint32_t lane) {
            if ((active_ >> lane & 1) == 0) return;
            const std::uint32_t key = first_key_ + lane;
            const std::uint32_t count = slots_.kept == nullptr ? 1 : slots_.leaf_count[key];
            at_.last[lane] = key + count - 1;
            at_.height[lane] = 0;
            at_.link[lane] = key;
            at_.count[lane] = count;
            at_.boxes.set(lane, leaf_box_(key, count));
        });
    }

    /// The lane of the right child, if the subtree of `lane` is a left one.
    [[nodiscard]] RAYDIX_HD std::uint32_t partner_of(std::uint32_t lane) const {
        const bool is_left = (active_ >> lane & 1) != 0 && at_.slot[lane] % 2 == 0;
        const std::uint32_t partner = at_.last[lane] + 1 - first_key_;
        return is_left && partner < warp_lanes ? partner : lane;
    }

    /// Puts every two children that are done below their parent. False if there were none.
    RAYDIX_HD bool join_children() {
        const Var<std::uint32_t> other_slot =
            warp_.shuffle(at_.slot, [&](std::uint32_t lane) { return partner_of(lane); });
        // The key behind a subtree's last begins another one, or there is none: no lane's slot is
        // an old one.
        const std::uint32_t lefts = warp_.ballot([&](std::uint32_t lane) {
            return partner_of(lane) != lane && other_slot[lane] == at_.slot[lane] + 1;
        });
        if (lefts == 0) return false;
        const std::uint32_t rights = warp_.ballot([&](std::uint32_t lane) {
            const std::uint32_t before = active_before(lane);
            return (active_ >> lane & 1) != 0 && before != lane && (lefts >> before & 1) != 0;
        });
        const auto partner = [&](std::uint32_t lane) { return partner_of(lane); };
        const Var<std::uint32_t> last = warp_.shuffle(at_.last, partner);
        const Var<std::uint32_t> height = warp_.shuffle(at_.height, partner);
        const WarpBoxes<Warp> boxes = at_.boxes.taken_from(warp_, partner);
        warp_.each([&](std::uint32_t lane) {
            if (((lefts | rights) >> lane & 1) != 0)
                store_whole(nodes_ + at_.slot[lane], at_.node(lane));
            if ((lefts >> lane & 1) == 0) return;
            at_.link[lane] = pair_slot(rank_of_slot(at_.slot[lane]));
            at_.count[lane] = 0;
            at_.last[lane] = last[lane];
            at_.height[lane] = 1 + larger(at_.height[lane], height[lane]);
            at_.boxes.set(lane, unite(at_.boxes.get(lane), boxes.get(lane)));
        });
        active_ &= ~rights;
        // An inner node's index is its first or its last key: the warp has its slot.
        const Var<std::uint32_t> next = warp_.shuffle(inner_slot_, [&](std::uint32_t lane) {
            const bool joined = (lefts >> lane & 1) != 0;
            return joined ? rank_of_slot(at_.link[lane]) - first_rank_ : lane;
        });
        warp_.each([&](std::uint32_t lane) {
            if ((lefts >> lane & 1) != 0) at_.slot[lane] = next[lane];
        });
        return true;
    }

    /// The next lane below that has a subtree, which is the one before in the order of keys; or
    /// this lane.
    [[nodiscard]] RAYDIX_HD std::uint32_t active_before(std::uint32_t lane) const {
        const std::uint32_t below = active_ & ((1u << lane) - 1);
        return below != 0 ? highest_set_bit(below) : lane;
    }

    /// Up from what a warp cannot finish by itself.
    RAYDIX_HD void climb(std::uint32_t lane) const {
        BvhNode node = at_.node(lane);
        std::uint32_t slot = at_.slot[lane], height = at_.height[lane];
        for (;;) {
            store_whole(nodes_ + slot, node);
            if (slot == 0) {
                clear_padding(nodes_);
                *max_depth_ = height;
                return;
            }
            const std::uint32_t rank = rank_of_slot(slot);
            const std::uint32_t other =
                arrive(slots_.meeting[rank], static_cast<std::uint8_t>(height + 1));
            if (other == 0) return;
            height = 1 + larger(height, other - 1);
            set_box(node, unite(box_of(node), box_of(nodes_[slot ^ 1])));
            link_inner(node, rank);
            slot = slots_.of_inner[rank];
        }
    }

    [[nodiscard]] RAYDIX_HD static std::uint32_t larger(std::uint32_t a, std::uint32_t b) {
        return a > b ? a : b;
    }

    const Warp& warp_;
    const LeafBox& leaf_box_;
    const ParentSlots& slots_;
    BvhNode* nodes_;
    std::uint32_t* max_depth_;

    std::uint32_t first_key_ = 0, first_rank_ = 0;
    std::uint32_t active_ = 0;  // bit k: lane k has a subtree
    WarpSubtrees<Warp> at_;
    Var<std::uint32_t> inner_slot_;
};

/// One work item per 32 keys. A tree without inner nodes is left alone.
template <class LeafBox>
struct ClimbWarps {
    LeafBox leaf_box;  // (first, count) -> box
    ParentSlots slots;
    BvhNode* nodes;            // [2 * inner + 2], out
    std::uint32_t* max_depth;  // [1], out

    template <class Warp>
    RAYDIX_HD void operator()(const Warp& warp, std::uint32_t w) const {
        if (*slots.inner_count == 0) return;
        WarpClimb<Warp, LeafBox>(warp, leaf_box, slots, nodes, max_depth).run(w * warp_lanes);
    }
};

}  // namespace raydix
