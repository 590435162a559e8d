// Locally-ordered clustering along the radix tree, in one pass (Benthin, Meister, Barczak,
// Mehalwal, Tsakok and Kensler 2024, "H-PLOC"). Each lane of a warp climbs from a primitive as in
// Apetrei's builder; where a node with more than half a warp of primitives is complete, the whole
// warp merges the lists of its children until half a warp of clusters is left. What a node keeps
// depends on its children's lists alone, and where it lies on its children: no counter is asked.
#pragma once

#include <cstdint>

#include "base/atomic.h"
#include "base/wide_store.h"
#include "exec/warp.h"
#include "exec/warp_boxes.h"
#include "tree/cluster.h"
#include "tree/radix_tree.h"

namespace raydix {

inline constexpr std::uint32_t hploc_radius = 8;
/// Clusters that a node of the radix tree hands to its parent, at most.
inline constexpr std::uint32_t hploc_list = warp_lanes / 2;

/// The arrays of one build. `Boxes` gives the box of a primitive by its place: get(place).
template <class Key, class Boxes>
struct HplocArrays {
    SortedKeys<Key> keys;      // [n]
    const std::uint32_t* ids;  // [n] in Morton order
    Boxes boxes;               // [n] in Morton order
    std::uint32_t max_leaf;
    ClusterRef* lists;       // [n], primitives before; a list begins where its primitives begin
    std::uint32_t* meeting;  // [n - 1], zero before
    /// [greatest id + 1], out. Each merge ends the career of one smallest id, that of the child
    /// with the greater one: this id is the node's place. The smallest id of all has no node.
    ClusterNode* nodes;
    ClusterRef* root;  // [1], out
};

/// Ends a list of fewer than hploc_list clusters that has room behind it.
inline constexpr ClusterRef end_of_list = 0xFFFFFFFFu;

/// The clusters that a warp merges, one per lane from lane 0 on.
template <class Warp>
struct WarpClusters {
    template <class T>
    using Var = typename Warp::template Var<T>;

    std::uint32_t count = 0;
    Var<ClusterRef> ref;
    WarpBoxes<Warp> boxes;

    /// Lane k gets the cluster of lane source(k).
    template <class Source>
    RAYDIX_HD WarpClusters taken_from(const Warp& warp, const Source& source) const {
        return {count, warp.shuffle(ref, source), boxes.taken_from(warp, source)};
    }
};

/// One warp's part of the pass: 32 primitives climb.
template <class Warp, class Key, class Boxes>
class HplocWarp {
public:
    template <class T>
    using Var = typename Warp::template Var<T>;
    using Clusters = WarpClusters<Warp>;

    RAYDIX_HD explicit HplocWarp(const HplocArrays<Key, Boxes>& arrays) : a_(arrays) {}

    RAYDIX_HD void run(std::uint32_t warp_index) {
        const std::uint32_t n = a_.keys.count;
        first_key_ = warp_index * warp_lanes;
        climbing_ = warp_.ballot([&](std::uint32_t lane) {
            first_[lane] = last_[lane] = first_key_ + lane;
            return first_[lane] < n && n > 1;
        });
        join_children();
        while (climbing_ != 0) {
            climbing_ = warp_.ballot(
                [&](std::uint32_t lane) { return (climbing_ >> lane & 1) != 0 && climb(lane); });
            merge(climbing_);
        }
    }

private:
    RAYDIX_HD bool is_root(std::uint32_t lane) const {
        return first_[lane] == 0 && last_[lane] == a_.keys.count - 1;
    }

    /// Of the lanes that came to a new node, those merge that have much to merge. The root climbs
    /// no further.
    RAYDIX_HD void merge(std::uint32_t arrived) {
        std::uint32_t merging = warp_.ballot([&](std::uint32_t lane) {
            return (arrived >> lane & 1) != 0 &&
                   (last_[lane] - first_[lane] + 1 > hploc_list || is_root(lane));
        });
        // A lane that met the other child in climb() alone has acquired what its warp wrote.
        if (merging != 0) warp_.sync();
        for (; merging != 0; merging &= merging - 1) {
            const std::uint32_t lane = nth_set_bit(merging, 0);
            merge_children(warp_.broadcast(first_, lane), warp_.broadcast(split_, lane),
                           warp_.broadcast(last_, lane));
        }
        climbing_ &= ~warp_.ballot([&](std::uint32_t lane) { return is_root(lane); });
    }

    /// As far up as both children of a node end in this warp: they meet by shuffles, the left one
    /// goes on.
    RAYDIX_HD void join_children() {
        const auto index = [&](std::uint32_t lane) { return std::int64_t{first_key_} + lane; };
        const int outside = a_.keys.common_prefix(index(0), index(0) - 1);
        Var<int> prefix;  // with the next key
        warp_.each([&](std::uint32_t lane) {
            prefix[lane] = a_.keys.common_prefix(index(lane), index(lane) + 1);
        });
        const Var<int> before = warp_.shuffle(prefix, [&](std::uint32_t lane) { return lane - 1; });
        for (;;) {
            const Var<int> behind =
                warp_.shuffle(prefix, [&](std::uint32_t lane) { return last_[lane] - first_key_; });
            const std::uint32_t lefts = climbing_ & warp_.ballot([&](std::uint32_t lane) {
                return behind[lane] > (lane == 0 ? outside : before[lane]);
            });
            const auto partner = [&](std::uint32_t lane) { return last_[lane] + 1 - first_key_; };
            const std::uint32_t joins = lefts & warp_.ballot([&](std::uint32_t lane) {
                const std::uint32_t right = partner(lane);
                return right < warp_lanes && (climbing_ & ~lefts) >> right & 1;
            });
            if (joins == 0) return;
            const Var<std::uint32_t> end = warp_.shuffle(last_, partner);
            const std::uint32_t rights = climbing_ & ~lefts & warp_.ballot([&](std::uint32_t lane) {
                // The left child is that of the next lane below that climbs.
                const std::uint32_t below = climbing_ & ((1u << lane) - 1);
                return below != 0 && (joins >> highest_set_bit(below) & 1) != 0;
            });
            warp_.each([&](std::uint32_t lane) {
                if ((joins >> lane & 1) == 0) return;
                split_[lane] = last_[lane] + 1;
                last_[lane] = end[lane];
            });
            climbing_ &= ~rights;
            merge(joins);
        }
    }

    /// To the parent, whose split lies on the side with the longer common prefix. False for the
    /// first child to come.
    RAYDIX_HD bool climb(std::uint32_t lane) {
        const std::int64_t first = first_[lane], last = last_[lane];
        const bool left_child =
            a_.keys.common_prefix(last, last + 1) > a_.keys.common_prefix(first, first - 1);
        const std::uint32_t parent = left_child ? last_[lane] : first_[lane] - 1;
        const std::uint32_t own_end = left_child ? first_[lane] : last_[lane];
        const std::uint32_t other_end = arrive(a_.meeting[parent], own_end + 1);
        if (other_end == 0) return false;
        if (left_child)
            last_[lane] = other_end - 1;
        else
            first_[lane] = other_end - 1;
        split_[lane] = parent + 1;
        return true;
    }

    /// The node over [first, last], whose right child begins at `split`.
    RAYDIX_HD void merge_children(std::uint32_t first, std::uint32_t split, std::uint32_t last) {
        const bool root = first == 0 && last == a_.keys.count - 1;
        Clusters list = load_children(first, split, last);
        while (list.count > (root ? 1u : hploc_list)) list = merge_once(list);
        warp_.each([&](std::uint32_t lane) {
            if (lane < list.count) a_.lists[first + lane] = list.ref[lane];
            if (lane == list.count && lane < hploc_list && first + lane <= last)
                a_.lists[first + lane] = end_of_list;
            if (root && lane == 0) *a_.root = list.ref[lane];
        });
        warp_.sync();
    }

    /// The left child's list, then the right one's.
    RAYDIX_HD Clusters load_children(std::uint32_t first, std::uint32_t split, std::uint32_t last) {
        Var<ClusterRef> loaded;
        const std::uint32_t present = warp_.ballot([&](std::uint32_t lane) {
            const std::uint32_t k = lane % hploc_list;
            const std::uint32_t place = (lane < hploc_list ? first : split) + k;
            const std::uint32_t end = lane < hploc_list ? split : last + 1;
            loaded[lane] = place < end ? a_.lists[place] : end_of_list;
            return loaded[lane] != end_of_list;
        });
        Clusters list;
        const std::uint32_t left = leading_run(present & 0xFFFFu);
        const std::uint32_t right = leading_run(present >> hploc_list);
        list.count = left + right;
        list.ref = warp_.shuffle(loaded, [&](std::uint32_t lane) {
            return lane < left ? lane : lane - left + hploc_list;
        });
        warp_.each([&](std::uint32_t lane) {
            if (lane < list.count) list.boxes.set(lane, box_of_cluster(list.ref[lane]));
        });
        return list;
    }

    /// How many lowest bits are set before the first that is not: what lies behind the end of a
    /// list is not its.
    RAYDIX_HD static std::uint32_t leading_run(std::uint32_t half) { return nth_set_bit(~half, 0); }

    /// One round: each cluster's nearest neighbour, mutual ones merge, the rest moves up.
    RAYDIX_HD Clusters merge_once(const Clusters& list) {
        const Var<std::uint32_t> nearest = find_nearest(list);
        const Var<std::uint32_t> back =
            warp_.shuffle(nearest, [&](std::uint32_t lane) { return nearest[lane]; });
        const auto mutual = [&](std::uint32_t lane) {
            return lane < list.count && nearest[lane] != lane && back[lane] == lane;
        };
        const std::uint32_t merges =
            warp_.ballot([&](std::uint32_t lane) { return mutual(lane) && lane < nearest[lane]; });
        const std::uint32_t rest = warp_.ballot([&](std::uint32_t lane) {
            return lane < list.count && !(mutual(lane) && lane > nearest[lane]);
        });
        const Clusters other =
            list.taken_from(warp_, [&](std::uint32_t lane) { return nearest[lane]; });
        Clusters merged = list;
        warp_.each([&](std::uint32_t lane) {
            if ((merges >> lane & 1) == 0) return;
            const ClusterPart mine = part(list, lane), its = part(other, lane);
            const std::uint32_t node_index =
                mine.sum.least > its.sum.least ? mine.sum.least : its.sum.least;
            const ClusterNode node = merge_clusters(mine, its, a_.max_leaf);
            store_whole(a_.nodes + node_index, node);
            merged.ref[lane] = node_index;
            merged.boxes.set(lane, {node.lo, node.hi});
        });
        warp_.sync();
        Clusters next =
            merged.taken_from(warp_, [&](std::uint32_t lane) { return nth_set_bit(rest, lane); });
        next.count = ones(rest);
        return next;
    }

    /// Per lane the lane with the least (area of the union, distance, tie_goes_right); its own if
    /// it is alone.
    RAYDIX_HD Var<std::uint32_t> find_nearest(const Clusters& list) {
        Var<float> best;
        Var<std::uint32_t> nearest;
        warp_.each([&](std::uint32_t lane) {
            best[lane] = infinity;
            nearest[lane] = lane;
        });
        for (std::uint32_t d = 1; d <= hploc_radius; ++d) {
            const Clusters ahead =
                list.taken_from(warp_, [&](std::uint32_t lane) { return lane + d; });
            Var<float> right;
            warp_.each([&](std::uint32_t lane) {
                right[lane] = lane + d < list.count
                                  ? cluster_area(unite(list.boxes.get(lane), ahead.boxes.get(lane)))
                                  : infinity;
            });
            const Var<float> behind =
                warp_.shuffle(right, [&](std::uint32_t lane) { return lane - d; });
            warp_.each([&](std::uint32_t lane) {
                const float left = lane >= d ? behind[lane] : infinity;
                const bool goes_right =
                    right[lane] < left || (right[lane] == left && tie_goes_right(lane, d));
                const float area = goes_right ? right[lane] : left;
                if (lane < list.count && area < best[lane]) {
                    best[lane] = area;
                    nearest[lane] = goes_right ? lane + d : lane - d;
                }
            });
        }
        return nearest;
    }

    RAYDIX_HD Aabb box_of_cluster(ClusterRef ref) const {
        if (is_primitive(ref)) return a_.boxes.get(ref & ~primitive_cluster);
        return {a_.nodes[ref].lo, a_.nodes[ref].hi};
    }
    RAYDIX_HD ClusterPart part(const Clusters& list, std::uint32_t lane) const {
        const ClusterRef ref = list.ref[lane];
        const Aabb box = list.boxes.get(lane);
        return {ref, box,
                is_primitive(ref) ? sum_of_primitive(a_.ids[ref & ~primitive_cluster], box)
                                  : a_.nodes[ref].sum};
    }
    RAYDIX_HD static std::uint32_t ones(std::uint32_t mask) {
        return static_cast<std::uint32_t>(count_ones(std::uint64_t{mask}));
    }

    Warp warp_;
    HplocArrays<Key, Boxes> a_;
    std::uint32_t first_key_ = 0, climbing_ = 0;  // bit k: lane k
    Var<std::uint32_t> first_, last_, split_;
};

}  // namespace raydix
