#include "tree/ploc.h"

#include <algorithm>
#include <array>
#include <memory>

#include "exec/parallel.h"
#include "exec/progress.h"
#include "tree/nearest_cluster.h"
#include "tree/survivors.h"

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
            std::span<std::byte> spare, const PlocOptions& options)
        : ids_(ids),
          max_leaf_(max_leaf),
          scratch_(scratch),
          spare_(spare),
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
        const double all = count_;
        for (std::size_t to = 0; count_ > 1; to = 1 - to) {
            // A round takes as long as its list; most leave half of it.
            const double left = count_ / all;
            const ProgressStage round(1 - left, 1 - 0.5 * left);
            const std::uint32_t merges = choose_partners(*boxes, slow);
            const std::uint32_t rest = count_ - merges;
            ClusterList& next = list_for(to, rest);
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
    /// Lists only grow shorter: what was borrowed for the first of two rounds does for all others.
    ClusterList& list_for(std::size_t to, std::uint32_t size) {
        ClusterList& borrowed = borrowed_[to];
        if (!borrowed.refs.empty()) return borrowed;
        constexpr std::size_t line = 64;
        const auto lines = [](std::size_t bytes) { return (bytes + line - 1) / line * line; };
        const std::size_t boxes = lines(BoxLanes::floats_for(size) * sizeof(float));
        const std::size_t refs = lines(size * sizeof(ClusterRef));
        void* memory = spare_.data();
        std::size_t room = spare_.size();
        if (std::align(line, boxes + refs, memory, room) == nullptr) {
            ClusterList& own = scratch_.lists[to];
            own.boxes.reset(size);
            own.refs.reset(size);
            return own;
        }
        auto* bytes = static_cast<std::byte*>(memory);
        borrowed.boxes.place(reinterpret_cast<float*>(bytes), size);
        borrowed.refs = {nullptr, reinterpret_cast<ClusterRef*>(bytes + boxes), size};
        spare_ = {bytes + boxes + refs, room - boxes - refs};
        return borrowed;
    }

    struct From {
        const BoxLanes& boxes;
        const ClusterRef* refs;
    };

    /// Fills partners and the number of merges before each block; returns how many there are.
    std::uint32_t choose_partners(const BoxLanes& boxes, bool pair_neighbours) {
        std::int8_t* partners = scratch_.partners.data();
        const std::size_t blocks = (count_ + partner_block - 1) / partner_block;
        scratch_.block_sums.reset(blocks);
        const ProgressCounter progress(count_, 0, 0.5);
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
                progress.add(static_cast<double>(end - begin));
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
        const ProgressCounter progress(count_, 0.5, 1);
        for_each_block(
            count_, partner_block, [&](std::size_t b, std::size_t begin, std::size_t end) {
                const std::uint32_t node_base = scratch_.block_sums[b];
                // A pair vanishes from the list at its right place: one that reaches
                // into this block is still due.
                const std::uint32_t at =
                    static_cast<std::uint32_t>(begin) - node_base + crossing(begin);
                Survivors block;
                keep_survivors(scratch_.partners.data(), static_cast<std::uint32_t>(begin),
                               static_cast<std::uint32_t>(end), copy_of(from, next, at), block);
                merge_pairs(from, block, next, {nodes_ + node_base, at});
                progress.add(static_cast<double>(end - begin));
            });
    }

    static ListCopy copy_of(const From& from, ClusterList& next, std::uint32_t at) {
        ListCopy copy{{}, from.refs, {}, next.refs.data() + at};
        for (std::size_t c = 0; c < 6; ++c) {
            copy.lanes[c] = from.boxes.lane(c);
            copy.to_lanes[c] = next.boxes.lane(c) + at;
        }
        return copy;
    }

    /// Where a block's nodes and its part of the next list begin.
    struct BlockOutput {
        std::uint32_t node_index, at;
    };
    void merge_pairs(const From& from, const Survivors& block, ClusterList& next,
                     const BlockOutput& out) {
        constexpr std::uint32_t ahead = 8;
        const std::int8_t* partners = scratch_.partners.data();
        const auto prefetch = [&](std::uint32_t i) {
            const ClusterRef ref = ref_at(from, i);
            if (!is_primitive(ref)) __builtin_prefetch(&scratch_.nodes[ref].sum);
        };
        for (std::uint32_t m = 0; m < block.pair_count; ++m) {
            if (m + ahead < block.pair_count) {
                const std::uint32_t i = block.places[block.pairs[m + ahead]];
                prefetch(i);
                prefetch(i + static_cast<std::uint32_t>(partners[i]));
            }
            const std::uint32_t i = block.places[block.pairs[m]];
            const ClusterNode node = merge_clusters(
                part(from, i), part(from, i + static_cast<std::uint32_t>(partners[i])), max_leaf_);
            scratch_.nodes[out.node_index + m] = node;
            const std::uint32_t at = out.at + block.pairs[m];
            next.boxes.set(at, {node.lo, node.hi});
            next.refs[at] = out.node_index + m;
        }
    }

    /// How many pairs have their left cluster before `begin` and their right one not.
    [[nodiscard]] std::uint32_t crossing(std::size_t begin) const {
        const std::int8_t* partners = scratch_.partners.data();
        const std::size_t first = begin > max_radius ? begin - max_radius : 0;
        std::uint32_t pairs = 0;
        for (std::size_t i = first; i < begin; ++i)
            pairs += static_cast<int>(begin - i) <= partners[i];
        return pairs;
    }

    static ClusterRef ref_at(const From& from, std::uint32_t i) {
        return from.refs != nullptr ? from.refs[i] : primitive_cluster | i;
    }
    [[nodiscard]] ClusterPart part(const From& from, std::uint32_t i) const {
        const ClusterRef ref = ref_at(from, i);
        const Aabb box = from.boxes.get(i);
        return {ref, box,
                is_primitive(ref) ? sum_of_primitive(ids_[ref & ~primitive_cluster], box)
                                  : scratch_.nodes[ref].sum};
    }

    std::span<const std::uint32_t> ids_;
    std::uint32_t max_leaf_;
    PlocScratch& scratch_;
    std::span<std::byte> spare_;
    std::array<ClusterList, 2> borrowed_;
    const PlocOptions& options_;
    std::uint32_t count_;
    std::uint32_t nodes_ = 0;
};

}  // namespace

ClusterRef build_ploc(std::span<const std::uint32_t> ids, std::uint32_t max_leaf,
                      PlocScratch& scratch, std::span<std::byte> spare,
                      const PlocOptions& options) {
    return PlocRun(ids, max_leaf, scratch, spare, options).run();
}

}  // namespace raydix
