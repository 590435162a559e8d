// Collapsed subtrees -> nodes and triangle blocks of one part of a WideBvh.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "base/math.h"
#include "layout/about_middle.h"
#include "layout/collapse_plan.h"
#include "layout/node_slots.h"
#include "layout/search_odds.h"
#include "layout/wide_bvh.h"
#include "layout/wide_part.h"

namespace raydix {

/// A child on its way into a node. `word` as in WideNode::child; inner_word: its node comes later.
struct WideChild {
    static constexpr std::uint32_t inner_word = 0;
    Aabb box;
    std::uint32_t word;
    std::uint32_t source;  // the caller's name for it
    SearchOdds odds;
};

template <int width, class View>
class WidePartWriter {
public:
    using Collapsed = Collapse<width, View>;

    /// Compact nodes and blocks, or plain ones.
    WidePartWriter(const View& view, bool compact, WidePart& out)
        : view_(view), compact_(compact), middle_(view.middle()), out_(out) {}

    /// An empty node; returns its number.
    std::uint32_t add_node() {
        const auto w = static_cast<std::uint32_t>(out_.node_count());
        std::fill_n(
            compact_ ? out_.compact_nodes.emplace_back().child : out_.nodes.emplace_back().child,
            quantised_width, wide_no_child);
        return w;
    }

    /// Puts children into a node that has none, and calls wait(source, slot) for those that are
    /// inner nodes. The node is `depth` edges below the root of the tree.
    template <class Wait>
    void fill_node(std::uint32_t w, std::span<const WideChild> children, std::uint32_t depth,
                   const Wait& wait) {
        out_.sums.levels = std::max(out_.sums.levels, depth + 1);
        Aabb all = empty_box();
        for (const WideChild& child : children) {
            all = unite(all, child.box);
            add_figures(child);
        }
        const SlotOrder order = write_slots(w, children, all);
        for (std::uint32_t slot = 0; slot < children.size(); ++slot)
            if (children[order[slot]].word == WideChild::inner_word)
                wait(children[order[slot]].source, slot);
        if (!children.empty()) out_.sums.node_area += half_area(all);
    }

    void set_child(std::uint32_t w, std::uint32_t slot, std::uint32_t word) {
        (compact_ ? out_.compact_nodes[w].child : out_.nodes[w].child)[slot] = word;
    }

    /// Writes the wide nodes of a subtree depth first: what rays visit together lies together, at
    /// every size of page and cache. Returns the number of the first.
    std::uint32_t write(const Collapsed& subtree, std::uint32_t depth) {
        const auto first = static_cast<std::uint32_t>(out_.node_count());
        waiting_.assign(1, {0, no_parent, 0, depth});
        std::array<std::uint32_t, width> chosen;
        std::array<WideChild, width> children;
        while (!waiting_.empty()) {
            const Waiting at = waiting_.back();
            waiting_.pop_back();
            const std::uint32_t w = add_node();
            if (at.parent != no_parent) set_child(at.parent, at.slot, w);
            std::size_t count = 0;
            const auto all = static_cast<std::size_t>(subtree.children(at.entry, chosen));
            for (std::size_t k = 0; k < all; ++k) {
                const std::uint32_t word = subtree.is_leaf(chosen[k])
                                               ? leaf_word(subtree, chosen[k])
                                               : WideChild::inner_word;
                if (word != wide_no_child)
                    children[count++] = {subtree.entry(chosen[k]).box, word, chosen[k],
                                         subtree.odds(chosen[k])};
            }
            fill_node(w, std::span(children).first(count), at.depth,
                      [&](std::uint32_t entry, std::uint32_t slot) {
                          waiting_.push_back({entry, w, slot, at.depth + 1});
                      });
        }
        return first;
    }

    /// The word of a leaf; wide_no_child if none of its triangles has an area: those are left out.
    std::uint32_t leaf_word(const Collapsed& subtree, std::uint32_t leaf) {
        std::uint32_t kept = 0;
        subtree.for_each_primitive(leaf, [&](std::uint32_t position) {
            if (view_.is_flat(position)) return;
            copies_.push_back({position, 0});
            ++kept;
        });
        if (kept == 0) return wide_no_child;
        const std::uint32_t place = out_.filler.place(kept);
        for (std::uint32_t j = 0; j < kept; ++j)
            copies_[copies_.size() - kept + j].place = place + j;
        return wide_leaf_bit | place << 3 | (kept - 1);
    }

    /// When all leaves have their places.
    void write_triangles() { compact_ ? list_corners() : copy_triangles(); }

private:
    /// Boxes and words of the children, in the order that is returned.
    SlotOrder write_slots(std::uint32_t w, std::span<const WideChild> children, const Aabb& all) {
#if defined(RAYDIX_X86_INTRINSICS)
        if (with_avx2_ && !compact_) return write_slots_avx2(children, middle_, out_.nodes[w]);
#endif
        const SlotOrder order = by_search_rank(children);
        SlotBoxes by_slot;
        for (std::uint32_t slot = 0; slot < children.size(); ++slot) {
            const WideChild& child = children[order[slot]];
            by_slot.set(static_cast<int>(slot), child.box);
            set_child(w, slot, child.word);
        }
        if (!compact_) {
            set_boxes_about(middle_, by_slot, out_.nodes[w]);
        } else if (!children.empty()) {
            CompactNode& node = out_.compact_nodes[w];
            node.used = static_cast<std::uint8_t>(by_slot.used);
            set_boxes(node, quantise(by_slot, all));
            out_.sums.decoded_area += decoded_area(node);
        }
        return order;
    }

#if defined(RAYDIX_X86_INTRINSICS)
    __attribute__((target("avx2"))) static SlotOrder write_slots_avx2(
        std::span<const WideChild> children, Vec3 middle, WideNode& node) {
        EightRows rows;
        alignas(32) std::array<float, 8> costs{};
        for (std::size_t k = 0; k < 8; ++k) {
            if (k >= children.size()) {
                rows[k] = _mm256_setr_ps(infinity, infinity, infinity,
                                         std::bit_cast<float>(wide_no_child), -infinity, -infinity,
                                         -infinity, infinity);
                continue;
            }
            const WideChild& child = children[k];
            const __m128 lo_hi = _mm_loadu_ps(&child.box.lo.x),  // lo.x, lo.y, lo.z, hi.x
                hi = _mm_setr_ps(child.box.hi.x, child.box.hi.y, child.box.hi.z, child.odds.hits);
            costs[k] = child.odds.cost;
            const __m128i lo =
                _mm_insert_epi32(_mm_castps_si128(lo_hi), static_cast<int>(child.word), 3);
            rows[k] = _mm256_set_m128(hi, _mm_castsi128_ps(lo));
        }
        return write_slots_within_avx2(rows, _mm256_load_ps(costs.data()), middle, node);
    }
#endif

    /// The children's places: rays that stop at any hit take the last slot first. Equal ranks keep
    /// their order.
    static SlotOrder by_search_rank(std::span<const WideChild> children) {
        SlotOrder order{};
        std::iota(order.begin(), order.end(), 0u);
        order_for_search(std::span(order).first(children.size()),
                         [&](std::uint32_t k) { return children[k].odds; });
        return order;
    }

    static constexpr std::uint32_t no_parent = ~std::uint32_t{0};
    struct Waiting {
        std::uint32_t entry, parent, slot, depth;
    };
    struct Copy {
        std::uint32_t position, place;
    };

    void list_corners() {
        CompactBlock none;
        std::fill_n(&none.vertex[0][0], 3 * block_lanes, no_vertex);
        std::fill_n(none.prim, block_lanes, no_primitive);
        out_.compact_blocks.resize(out_.filler.blocks(), none);
        for (const auto [position, place] : copies_) {
            CompactBlock& block = out_.compact_blocks[place / BlockFiller::lanes];
            const std::uint32_t lane = place % BlockFiller::lanes;
            const std::array<std::uint32_t, 3> corners = view_.corners(position);
            for (std::size_t v = 0; v < 3; ++v) block.vertex[v][lane] = corners[v];
            block.prim[lane] = view_.id(position);
        }
    }
    void copy_triangles() {
        constexpr std::size_t indices_ahead = 32, corners_ahead = 16;
        out_.blocks.resize(out_.filler.blocks());
        for (std::size_t k = 0; k < copies_.size(); ++k) {
            if (k + indices_ahead < copies_.size()) {
                view_.prefetch_indices(copies_[k + indices_ahead].position);
                view_.prefetch_corners(copies_[k + corners_ahead].position);
            }
            const auto [position, place] = copies_[k];
            out_.blocks[place / BlockFiller::lanes].set(
                place % BlockFiller::lanes, view_.triangle(position), view_.id(position));
        }
    }

    void add_figures(const WideChild& child) {
        const double area = half_area(child.box);
        ++out_.sums.children;
        out_.sums.child_area += area;
        if ((child.word & wide_leaf_bit) == 0) return;
        const std::uint32_t triangles = (child.word & 7) + 1;
        ++out_.sums.leaves;
        out_.sums.references += triangles;
        out_.sums.triangle_area += area * triangles;
    }

    /// In double, to within a rounding.
    static double decoded_area(const CompactNode& node) {
        const double step[3] = {quantised_step(node.exponent[0]), quantised_step(node.exponent[1]),
                                quantised_step(node.exponent[2])};
        double sum = 0;
        for (int s = 0; s < quantised_width; ++s) {
            if ((node.used >> s & 1) == 0) continue;
            const double x = (node.hi[0][s] - node.lo[0][s]) * step[0],
                         y = (node.hi[1][s] - node.lo[1][s]) * step[1],
                         z = (node.hi[2][s] - node.lo[2][s]) * step[2];
            sum += x * y + y * z + z * x;
        }
        return sum;
    }

    const View& view_;
    bool compact_;
    Vec3 middle_;
#if defined(RAYDIX_X86_INTRINSICS)
    const bool with_avx2_ = __builtin_cpu_supports("avx2");
#endif
    WidePart& out_;
    std::vector<Waiting> waiting_;
    std::vector<Copy> copies_;
};

}  // namespace raydix
