// The two kernels of Karras 2012 as its sections 3 and 4 have them, beside ours in
// karras_launches.h and fit.h: leaves of one primitive, so that inner node i needs no other number
// than i; one launch for the hierarchy; boxes by an item per leaf that climbs, with a word per
// inner node to meet in. Where the paper adds one to that word, heights are left in it: the same
// exchange, and the depth comes out.
#pragma once

#include <cstdint>

#include "base/atomic.h"
#include "tree/fit.h"
#include "tree/lbvh_launches.h"

namespace raydix {

struct PublishedScratch {
    std::uint32_t* leaf_slot;  // [n]
    std::uint32_t* meeting;    // [n - 1]: 0; 1 + the height of the child that came first
    PublishedScratch(Arena& arena, std::uint32_t n)
        : leaf_slot(arena.take<std::uint32_t>(n)), meeting(arena.take<std::uint32_t>(n)) {}
};

/// Inner node i: its range, its split, its children.
template <class Key, class Probe>
struct LinkOwnNode {
    SortedKeys<Key, Probe> keys;
    PublishedScratch scratch;
    TreeLinks out;

    RAYDIX_HD void operator()(std::uint32_t node) const {
        const RadixRange range = find_range(keys, node);
        scratch.meeting[node] = 0;
        Probe::bytes(sizeof(std::uint32_t));
        child(pair_slot(node), range.split, range.first == range.split);
        child(pair_slot(node) + 1, range.split + 1, range.split + 1 == range.last);
        if (node != 0) return;
        link_inner(out.nodes[0], 0);
        clear_padding(out.nodes);
        out.parent_slot[0] = 0;
        *out.inner_count = keys.count - 1;
    }

private:
    RAYDIX_HD void child(std::uint32_t slot, std::uint32_t index, bool leaf) const {
        if (leaf) {
            link_leaf(out.nodes[slot], index, 1);
            scratch.leaf_slot[index] = slot;
        } else {
            link_inner(out.nodes[slot], index);
            out.parent_slot[index] = slot;
        }
        Probe::bytes(link_bytes + sizeof(std::uint32_t));
    }
};

/// The leaf of one key: its box, then up as long as it is the second to come.
template <class LeafBox, class Probe>
struct ClimbOwnLeaf {
    static constexpr std::uint32_t accesses_per_level = 2;  // meeting, then the sibling's box

    LeafBox leaf_box;
    PublishedScratch scratch;
    TreeLinks out;
    std::uint32_t* max_depth;  // [1], out

    RAYDIX_HD void operator()(std::uint32_t key) const {
        std::uint32_t slot = scratch.leaf_slot[key];
        set_box(out.nodes[slot], leaf_box(key, 1));
        Probe::bytes(sizeof(std::uint32_t) + sizeof(Aabb));
        Probe::step();
        for (std::uint32_t height = 0; slot != 0;) {
            const std::uint32_t rank = rank_of_slot(slot);
            const std::uint32_t other = arrive(scratch.meeting[rank], height + 1);
            Probe::bytes(sizeof(std::uint32_t));
            Probe::step();
            if (other == 0) return;
            height = 1 + (height > other - 1 ? height : other - 1);
            const BvhNode* pair = out.nodes + pair_slot(rank);
            slot = out.parent_slot[rank];
            set_box(out.nodes[slot], unite(box_of(pair[0]), box_of(pair[1])));
            Probe::bytes(sizeof(std::uint32_t) + 3 * sizeof(Aabb));
            Probe::step();
            if (slot != 0) continue;
            *max_depth = height;
            Probe::chain(2 + height * accesses_per_level);
        }
    }
};

/// in.count > 1; leaves hold one key whatever in.max_leaf says.
template <class Launcher, class Key>
void launch_karras_published(Launcher& launcher, const LbvhInput<Key>& in,
                             const PublishedScratch& scratch, const TreeLinks& out) {
    using Probe = typename Launcher::Probe;
    launcher.launch("karras.link", in.count - 1,
                    LinkOwnNode<Key, Probe>{{in.keys, in.count}, scratch, out});
}

/// Behind launch_karras_published.
template <class Launcher, class LeafBox>
void launch_fit_published(Launcher& launcher, const LeafBox& leaf_box, std::uint32_t key_count,
                          const PublishedScratch& scratch, const TreeLinks& out,
                          std::uint32_t* max_depth) {
    using Probe = typename Launcher::Probe;
    launcher.launch("fit.leaves", key_count,
                    ClimbOwnLeaf<LeafBox, Probe>{leaf_box, scratch, out, max_depth});
}

}  // namespace raydix
