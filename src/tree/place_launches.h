// A cluster tree -> the nodes and the primitive order of place_clusters.h, bit for bit, as launches
// for any backend. A node's number in preorder and its first primitive are sums over the links on
// its way up to the root. All nodes add them up together: each round doubles how far up a node has
// looked (pointer jumping; Wyllie 1979, list ranking).
//   start     how many rounds; the root
//   links     what each node adds to its parent's numbers
//   jump      one launch a round, empty ones where the tree is not that deep
//   emit      nodes that stay write their children; leaves list their primitives
#pragma once

#include <raydix/bvh.h>

#include <bit>
#include <cstdint>

#include "base/wide_store.h"
#include "exec/arena.h"
#include "tree/cluster.h"
#include "tree/lbvh_launches.h"

namespace raydix {

/// How far behind the node `above` a node stands.
struct alignas(16) PlacedLink {
    ClusterRef above;           // the root, once all rounds are over
    std::uint32_t rank, first;  // what to add to the numbers of `above`
    std::uint32_t in_leaf;      // 1: a node on the way up, not this one, became a leaf
};

/// The finished cluster tree of a builder that stores each node at an id below its root that is not
/// the least (hploc.h), and where it goes.
template <class Boxes>
struct ClusterPlacing {
    static constexpr std::uint32_t most_rounds = 32;

    const ClusterNode* clusters;
    const ClusterRef* root;      // [1]
    const std::uint32_t* count;  // [1]: primitives
    const std::uint32_t* ids;    // [n] in Morton order
    Boxes boxes;                 // [n] in Morton order
    std::uint32_t max_leaf;
    PlacedLink *even, *odd;                  // [greatest id + 1], of the rounds in turn
    std::uint32_t* rounds;                   // [most_rounds]: nodes at work in each
    BvhNode* nodes;                          // [2 * inner + 2], out
    std::uint32_t* order;                    // [n], out
    std::uint32_t *inner_count, *max_depth;  // [1], out

    /// True if there is a node at ids[place].
    [[nodiscard]] RAYDIX_HD bool has_node(std::uint32_t place) const {
        return !is_primitive(*root) && ids[place] != clusters[*root].sum.least;
    }
    [[nodiscard]] RAYDIX_HD bool is_leaf(ClusterRef ref) const {
        return is_primitive(ref) || clusters[ref].sum.inner == 0;
    }
    [[nodiscard]] RAYDIX_HD std::uint32_t count_of(ClusterRef ref) const {
        return is_primitive(ref) ? 1 : clusters[ref].sum.count;
    }
    [[nodiscard]] RAYDIX_HD std::uint32_t inner_of(ClusterRef ref) const {
        return is_primitive(ref) ? 0 : clusters[ref].sum.inner;
    }
    [[nodiscard]] RAYDIX_HD Aabb box_of_cluster(ClusterRef ref) const {
        if (is_primitive(ref)) return boxes.get(ref & ~primitive_cluster);
        return {clusters[ref].lo, clusters[ref].hi};
    }

    /// Writes one node; a leaf's primitives as well.
    RAYDIX_HD void write(std::uint32_t slot, ClusterRef ref, std::uint32_t rank,
                         std::uint32_t first) const {
        const Aabb box = box_of_cluster(ref);
        if (is_leaf(ref)) {
            store_whole(nodes + slot, BvhNode{box.lo, first, box.hi, count_of(ref)});
            list_primitives(ref, order + first);
        } else {
            store_whole(nodes + slot, BvhNode{box.lo, pair_slot(rank), box.hi, 0});
        }
    }

private:
    /// The primitives below `top` by ascending id. `out` is a list of clusters at first, in which
    /// each gives its place to its left child and puts the right one at the end.
    RAYDIX_HD void list_primitives(ClusterRef top, std::uint32_t* out) const {
        out[0] = top;
        std::uint32_t listed = 1;
        for (std::uint32_t i = 0; i < listed;) {
            const ClusterRef ref = out[i];
            if (is_primitive(ref)) {
                ++i;
            } else {
                out[i] = clusters[ref].left;
                out[listed++] = clusters[ref].right;
            }
        }
        for (std::uint32_t i = 0; i < listed; ++i) {
            const std::uint32_t id = ids[out[i] & ~primitive_cluster];
            std::uint32_t k = i;
            for (; k > 0 && out[k - 1] > id; --k) out[k] = out[k - 1];
            out[k] = id;
        }
    }
};

/// Item r decides on round r; the first one writes the root.
template <class Boxes>
struct StartPlacing {
    ClusterPlacing<Boxes> place;
    RAYDIX_HD void operator()(std::uint32_t round) const {
        const std::uint32_t count = *place.count;
        const bool many = count > 1;
        // Links up to the root from a node that stays, then up to the top of a leaf from within.
        const std::uint64_t links =
            many ? std::uint64_t{place.clusters[*place.root].sum.height} + place.max_leaf : 0;
        place.rounds[round] = many && (std::uint64_t{1} << round) < links ? count : 0;
        if (round != 0) return;
        clear_padding(place.nodes);
        *place.inner_count = many ? place.clusters[*place.root].sum.inner : 0;
        *place.max_depth = many ? place.clusters[*place.root].sum.height : 0;
        if (count != 0) place.write(0, *place.root, 0, 0);
    }
};

/// The links of the children of one node.
template <class Boxes>
struct LinkPlaced {
    ClusterPlacing<Boxes> place;
    RAYDIX_HD void operator()(std::uint32_t k) const {
        if (!place.has_node(k)) return;
        const ClusterRef ref = place.ids[k];
        const ClusterNode& node = place.clusters[ref];
        if (ref == *place.root) place.even[ref] = PlacedLink{ref, 0, 0, 0};
        link(node, node.left, PlacedLink{ref, 1, 0, 0});
        link(node, node.right,
             PlacedLink{ref, 1 + place.inner_of(node.left), place.count_of(node.left), 0});
    }

private:
    RAYDIX_HD void link(const ClusterNode& node, ClusterRef child, PlacedLink link) const {
        if (is_primitive(child)) return;
        link.in_leaf = node.sum.inner == 0 ? 1 : 0;
        place.even[child] = link;
    }
};

/// One round: the link of the node above, which reaches as far up again, is added to this one's.
template <class Boxes>
struct JumpPlaced {
    ClusterPlacing<Boxes> place;
    const PlacedLink* from;
    PlacedLink* to;
    RAYDIX_HD void operator()(std::uint32_t k) const {
        if (!place.has_node(k)) return;
        const ClusterRef ref = place.ids[k];
        const PlacedLink mine = from[ref], above = from[mine.above];
        to[ref] = {above.above, mine.rank + above.rank, mine.first + above.first,
                   mine.in_leaf | above.in_leaf};
    }
};

/// The children of one node that stays.
template <class Boxes>
struct EmitPlaced {
    ClusterPlacing<Boxes> place;
    RAYDIX_HD void operator()(std::uint32_t k) const {
        if (!place.has_node(k)) return;
        const ClusterRef ref = place.ids[k];
        std::uint32_t rounds = 0;
        while (rounds < place.most_rounds && place.rounds[rounds] != 0) ++rounds;
        const PlacedLink at = (rounds % 2 == 0 ? place.even : place.odd)[ref];
        if (at.in_leaf != 0 || place.is_leaf(ref)) return;
        const ClusterRef left = place.clusters[ref].left, right = place.clusters[ref].right;
        const std::uint32_t slot = pair_slot(at.rank);
        place.write(slot, left, at.rank + 1, at.first);
        place.write(slot + 1, right, at.rank + 1 + place.inner_of(left),
                    at.first + place.count_of(left));
    }
};

/// Scratch for ids below n.
struct PlaceScratch {
    PlacedLink *even, *odd;
    std::uint32_t* rounds;
    PlaceScratch(Arena& arena, std::uint32_t n)
        : even(arena.take<PlacedLink>(n)),
          odd(arena.take<PlacedLink>(n)),
          rounds(arena.take<std::uint32_t>(ClusterPlacing<int>::most_rounds)) {}
};

/// n: the most primitives there can be. Of an empty tree nothing but the padding is written.
template <class Launcher, class Boxes>
void launch_placing(Launcher& launcher, const ClusterPlacing<Boxes>& place, std::uint32_t n) {
    launcher.launch("place.start", place.most_rounds, StartPlacing<Boxes>{place});
    launcher.launch_counted("place.links", place.count, n, LinkPlaced<Boxes>{place});
    // A tree of n primitives is less than n deep.
    const auto rounds = static_cast<std::uint32_t>(std::bit_width(std::uint64_t{n} + 255));
    for (std::uint32_t r = 0; r < rounds; ++r) {
        if (!launcher.maybe_any(place.rounds + r)) break;
        const bool even = r % 2 == 0;
        launcher.launch_counted(
            "place.jump", place.rounds + r, n,
            JumpPlaced<Boxes>{place, even ? place.even : place.odd, even ? place.odd : place.even});
    }
    launcher.launch_counted("place.emit", place.count, n, EmitPlaced<Boxes>{place});
}

}  // namespace raydix
