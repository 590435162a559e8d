#include "tree/ploc.h"

#include <algorithm>
#include <limits>

#include "exec/parallel.h"
#include "tree/nearest_cluster.h"

namespace raydix {

std::size_t PlocScratch::capacity_bytes() const {
    std::size_t bytes = primitives.capacity_bytes() + nodes.capacity_bytes() +
                        partners.capacity_bytes() + block_sums.capacity_bytes();
    for (const ClusterList& list : lists)
        bytes += list.boxes.capacity_bytes() + list.refs.capacity_bytes();
    return bytes;
}

namespace {

/// A round that merges fewer than one cluster in this many is followed by one that pairs neighbours
/// whatever their areas: slowly growing boxes would else merge a pair a round.
constexpr std::uint32_t slow_round = 16;
/// Lists this short may take as many rounds as they like.
constexpr std::uint32_t short_list = 1024;

class PlocRun {
public:
    PlocRun(std::span<const std::uint32_t> ids, std::uint32_t max_leaf, PlocScratch& scratch,
            const PlocOptions& options)
        : ids_(ids),
          max_leaf_(max_leaf),
          scratch_(scratch),
          options_(options),
          count_(static_cast<std::uint32_t>(ids.size())) {}

    ClusterRef run() {
        if (count_ == 1) return primitive_cluster;
        scratch_.nodes.reset(count_ - 1);
        scratch_.partners.reset(count_);
        scratch_.primitives.close(count_);
        const BoxLanes* boxes = &scratch_.primitives;
        const ClusterRef* refs = nullptr;  // of the first round: the places themselves
        bool slow = false;
        for (std::size_t to = 0; count_ > 1; to = 1 - to) {
            const std::uint32_t merges = choose_partners(*boxes, slow);
            const std::uint32_t rest = count_ - merges;
            ClusterList& next = scratch_.lists[to];
            next.boxes.reset(rest);
            next.refs.reset(rest);
            merge_partners({*boxes, refs}, next);
            next.boxes.close(rest);
            slow = count_ > short_list && merges < count_ / slow_round;
            nodes_ += merges;
            count_ = rest;
            boxes = &next.boxes;
            refs = next.refs.data();
        }
        return refs[0];
    }

private:
    struct From {
        const BoxLanes& boxes;
        const ClusterRef* refs;
    };

    /// Fills partners and the number of merges before each block; returns how many there are.
    std::uint32_t choose_partners(const BoxLanes& boxes, bool pair_neighbours) {
        std::int8_t* partners = scratch_.partners.data();
        const std::size_t blocks = (count_ + partner_block - 1) / partner_block;
        scratch_.block_sums.reset(blocks);
        for_each_block(
            count_, partner_block, [&](std::size_t b, std::size_t begin, std::size_t end) {
                if (pair_neighbours) {
                    for (std::size_t i = begin; i < end; ++i)
                        partners[i] = (i ^ 1) < count_ ? (i % 2 == 0 ? 1 : -1) : 0;
                } else {
                    find_partners(boxes, static_cast<std::uint32_t>(begin),
                                  static_cast<std::uint32_t>(end), options_.radius, partners);
                }
                scratch_.block_sums[b] = static_cast<std::uint32_t>(
                    std::count_if(partners + begin, partners + end, [](auto p) { return p > 0; }));
            });
        std::uint32_t before = 0;
        for (std::size_t b = 0; b < blocks; ++b) {
            const std::uint32_t own = scratch_.block_sums[b];
            scratch_.block_sums[b] = before;
            before += own;
        }
        return before;
    }

    /// Writes a node per pair that merges, and the list of what is left, in order. A merged cluster
    /// takes the left place.
    void merge_partners(const From& from, ClusterList& next) {
        const std::int8_t* partners = scratch_.partners.data();
        for_each_block(
            count_, partner_block, [&](std::size_t b, std::size_t begin, std::size_t end) {
                std::uint32_t merge = scratch_.block_sums[b];
                // A pair vanishes from the list at its right place: one that reaches into this
                // block is still due.
                std::uint32_t at = static_cast<std::uint32_t>(begin) - merge + crossing(begin);
                for (auto i = static_cast<std::uint32_t>(begin); i < end; ++i) {
                    if (partners[i] < 0) continue;
                    const ClusterRef ref = ref_at(from, i);
                    const Aabb box = from.boxes.get(i);
                    if (partners[i] == 0) {
                        next.boxes.set(at, box);
                        next.refs[at] = ref;
                    } else {
                        const std::uint32_t j = i + static_cast<std::uint32_t>(partners[i]);
                        const ClusterRef other = ref_at(from, j);
                        const Aabb other_box = from.boxes.get(j);
                        const std::uint32_t node_index = nodes_ + merge++;
                        const ClusterNode node =
                            merge_clusters({ref, box, sum_of(ref, box)},
                                           {other, other_box, sum_of(other, other_box)}, max_leaf_);
                        scratch_.nodes[node_index] = node;
                        next.boxes.set(at, {node.lo, node.hi});
                        next.refs[at] = node_index;
                    }
                    ++at;
                }
            });
    }

    /// How many pairs have their left cluster before `begin` and their right one not.
    [[nodiscard]] std::uint32_t crossing(std::size_t begin) const {
        const std::int8_t* partners = scratch_.partners.data();
        const std::size_t first = begin > max_radius ? begin - max_radius : 0;
        std::uint32_t pairs = 0;
        for (std::size_t i = first; i < begin; ++i)
            if (partners[i] > 0 && i + static_cast<std::size_t>(partners[i]) >= begin) ++pairs;
        return pairs;
    }

    static ClusterRef ref_at(const From& from, std::uint32_t i) {
        return from.refs != nullptr ? from.refs[i] : primitive_cluster | i;
    }
    [[nodiscard]] ClusterSum sum_of(ClusterRef ref, const Aabb& box) const {
        return is_primitive(ref) ? sum_of_primitive(ids_[ref & ~primitive_cluster], box)
                                 : scratch_.nodes[ref].sum;
    }

    std::span<const std::uint32_t> ids_;
    std::uint32_t max_leaf_;
    PlocScratch& scratch_;
    const PlocOptions& options_;
    std::uint32_t count_;
    std::uint32_t nodes_ = 0;
};

}  // namespace

ClusterRef build_ploc(std::span<const std::uint32_t> ids, std::uint32_t max_leaf,
                      PlocScratch& scratch, const PlocOptions& options) {
    return PlocRun(ids, max_leaf, scratch, options).run();
}

}  // namespace raydix
