// Apetrei 2014 on the CPU: hierarchy and boxes in one bottom-up pass. Sorted codes [n] + a box for
// each leaf position -> nodes with boxes [2 * inner + 2] and the exact depth.
//
// The paper's threads climb from each leaf, take as parent the end of their range where the prefix
// is longer, and meet in atomic counters. Here a task owns a run of neighbouring positions and
// climbs for all of them, left to right: what waits for its right sibling lies on a stack whose
// prefixes grow towards the top. Ranges that reach over an end of the run are left over as few
// pieces; one last pass over the pieces of all runs, in order, does the same with them. Every node
// is written once, nothing is shared, and no counter is needed.
#pragma once

#include <raydix/buffer.h>
#include <raydix/bvh.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>

#include "base/check.h"
#include "base/float3.h"
#include "exec/progress.h"
#include "tree/kept_splits.h"
#include "tree/neighbour_prefixes.h"

namespace raydix {

/// A subtree whose box is known: what its node will hold.
struct Subtree {
    Box3 box;
    std::uint32_t first = 0, count = 0;  // as in BvhNode
    std::uint32_t height = 0;

    void write(BvhNode& node) const {
        box.lo.store(node.lo);
        node.first = first;
        box.hi.store(node.hi);
        node.count = count;
    }
};

/// A subtree, and the inner node that splits right of it: its prefix (1 + common; 0 behind the last
/// key) and rank.
struct Piece {
    Subtree subtree;
    std::uint32_t prefix, rank;
};

/// Merges subtrees that come from left to right as soon as both children of a node are there. What
/// waits for its right sibling is kept in order of prefixes, the longest on top.
class Climb {
public:
    static constexpr std::size_t most_open = 1 + 63 + 32;  // the prefixes that wait all differ

    explicit Climb(BvhNode* nodes) : nodes_(nodes) { open_[0].prefix = 0; }

    /// `right` ends at a split with `prefix`: whatever has a longer one lies below it and is
    /// complete now. `top` counts what waits; callers keep it in a register.
    [[nodiscard]] Subtree merge_above(Subtree right, std::uint32_t prefix, std::size_t& top) const {
        for (const Piece* left = &open_[top]; left->prefix > prefix; left = &open_[--top]) {
            BvhNode* pair = nodes_ + pair_slot(left->rank);
            left->subtree.write(pair[0]);
            right.write(pair[1]);
            right = {unite(left->subtree.box, right.box), pair_slot(left->rank), 0,
                     1 + std::max(left->subtree.height, right.height)};
        }
        return right;
    }
    void push(const Piece& piece, std::size_t& top) {
        ++top;
        RAYDIX_CHECK(top, <=, most_open);
        open_[top] = piece;
    }
    [[nodiscard]] const Piece& open(std::size_t k) const { return open_[k]; }

private:
    BvhNode* nodes_;
    std::array<Piece, most_open + 1> open_;
};

struct ClimbScratch {
    Buffer<std::uint8_t> prefixes;
    Buffer<std::uint64_t> kept_bits;
    Buffer<std::uint32_t> kept_before;
    Buffer<Piece> pieces;
    Buffer<std::uint32_t> piece_counts;
};

/// The climb inside one run of positions. Splits that are not kept lie inside leaves, so only the
/// kept ones are looked at, and what lies between two of them is a leaf.
template <class LeafBox>
struct ClimbRun {
    static constexpr std::size_t most_pieces = 2 * Climb::most_open + 1;

    const NeighbourPrefixes& prefixes;
    const KeptNodes& kept;
    const LeafBox& leaf_box;
    BvhNode* nodes;
    std::size_t n;

    /// The first kept split from s on, or n - 1, the last key.
    [[nodiscard]] std::size_t next_kept(std::size_t s) const {
        const std::size_t words = (n - 1 + word_bits - 1) / word_bits;
        std::size_t w = s / word_bits;
        if (w >= words) return n - 1;
        std::uint64_t word = kept.bits[w] >> (s % word_bits) << (s % word_bits);
        while (word == 0) {
            if (++w == words) return n - 1;
            word = kept.bits[w];
        }
        return w * word_bits + static_cast<std::size_t>(std::countr_zero(word));
    }
    /// Where the first leaf begins that does not begin before `nominal`.
    [[nodiscard]] std::size_t leaf_border(std::size_t nominal) const {
        return nominal == 0 || nominal >= n ? std::min(nominal, n) : next_kept(nominal - 1) + 1;
    }
    [[nodiscard]] Subtree leaf(std::size_t begin, std::size_t last) const {
        Box3 box = leaf_box(begin);
        for (std::size_t k = begin + 1; k <= last; ++k) box = unite(box, leaf_box(k));
        return {box, static_cast<std::uint32_t>(begin),
                static_cast<std::uint32_t>(last - begin + 1), 0};
    }
    /// Writes the nodes that lie within the run, and what is left of it as at most most_pieces
    /// pieces; returns their number.
    std::uint32_t operator()(std::size_t nominal_begin, std::size_t nominal_end,
                             Piece* pieces) const {
        const std::size_t end = leaf_border(nominal_end);
        std::size_t begin = leaf_border(nominal_begin);
        Climb climb(nodes);
        std::size_t top = 0;
        std::uint32_t piece_count = 0;
        if (begin >= end) return 0;
        std::uint32_t rank = kept.rank(static_cast<std::uint32_t>(begin));
        std::uint32_t left_border = *(prefixes.at(0) + begin - 1);
        for (; begin < end; ++rank) {
            const std::size_t s = next_kept(begin);
            const std::uint32_t prefix = *(prefixes.at(0) + s);
            const Piece piece{climb.merge_above(leaf(begin, s), prefix, top), prefix, rank};
            begin = s + 1;
            if (prefix > left_border) {
                climb.push(piece, top);
            } else {  // this node begins left of the run, and no node to its right reaches over it
                pieces[piece_count++] = piece;
                left_border = prefix;
            }
        }
        // Those that wait reach over the end of the run.
        for (std::size_t k = 1; k <= top; ++k) pieces[piece_count++] = climb.open(k);
        return piece_count;
    }
};

struct ApetreiTree {
    std::uint32_t inner = 0, max_depth = 0;
};

/// prefixes: of more than max_leaf keys. leaf_box(k) is called once for each position k, from left
/// to right within a task, and gives the Box3 of what lies there. The tree does not depend on
/// run_length.
template <class LeafBox>
ApetreiTree build_apetrei_cpu(const NeighbourPrefixes& prefixes, int max_leaf,
                              const LeafBox& leaf_box, Buffer<BvhNode>& nodes,
                              ClimbScratch& scratch, std::size_t run_length = 1u << 13) {
    const std::size_t n = prefixes.count();
    const std::uint32_t inner =
        mark_kept_splits(prefixes, n - 1, max_leaf, scratch.kept_bits, scratch.kept_before);
    const KeptNodes kept{scratch.kept_bits.data(), scratch.kept_before.data()};
    nodes.reset(2 * std::size_t{inner} + 2);
    using Run = ClimbRun<LeafBox>;
    const Run climb_run{prefixes, kept, leaf_box, nodes.data(), n};
    const std::size_t runs = (n + run_length - 1) / run_length;
    scratch.pieces.reset(runs * Run::most_pieces);
    scratch.piece_counts.reset(runs);
    const ProgressCounter progress(static_cast<double>(runs));
    for_each_block(n, run_length, [&](std::size_t run, std::size_t begin, std::size_t end) {
        scratch.piece_counts[run] =
            climb_run(begin, end, scratch.pieces.data() + run * Run::most_pieces);
        progress.add(1);
    });
    Climb climb(nodes.data());
    std::size_t top = 0;
    Subtree root;
    for (std::size_t run = 0; run < runs; ++run) {
        const Piece* pieces = scratch.pieces.data() + run * Run::most_pieces;
        for (std::uint32_t k = 0; k < scratch.piece_counts[run]; ++k) {
            root = climb.merge_above(pieces[k].subtree, pieces[k].prefix, top);
            climb.push({root, pieces[k].prefix, pieces[k].rank}, top);
        }
    }
    root.write(nodes[0]);
    nodes[1] = BvhNode{{0, 0, 0}, 0, {0, 0, 0}, 0};
    return {inner, root.height};
}

}  // namespace raydix
