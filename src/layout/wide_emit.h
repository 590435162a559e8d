// A view of a binary tree -> the nodes and triangle blocks of a WideBvh. Subtrees of some thousand
// primitives are collapsed, written and put behind each other, each while it is in a cache: the
// arrays do not depend on the number of threads.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "base/math.h"
#include "exec/large_pages.h"
#include "exec/parallel.h"
#include "exec/progress.h"
#include "layout/wide_part_writer.h"

namespace raydix {

/// A tree of few primitives is one part. In larger ones the top is a part of its own: there nodes
/// take their largest children apart until they are full, which needs no plan of what is below.
template <int width, class View>
class WideEmitter {
public:
    using Ref = typename View::Ref;

    WideEmitter(const View& view, const WideOptions& options, PartPool& pool)
        : view_(view), options_(options), pool_(pool) {}

    void run(WideBvh::Arrays& out) {
        std::unique_ptr<WidePart> top = take_part(pool_);
        if (view_.size(view_.root()) > most) {
            lay_out_top(*top);
        } else {
            roots_.push_back({view_.root(), 0});
        }
        PartPlacer placer(options_.compact, view_.size(view_.root()), roots_.size(), pool_, out);
        WidePart& top_part = *top;
        placer.set_top(std::move(top));
        write_parts(placer);
        fill_top(top_part);
        const WideSums sums = placer.finish();
        if (options_.compact) number_vertices(out);
        set_tree_figures(sums, view_.box(view_.root()), view_.middle(), out);
    }

private:
    using Writer = WidePartWriter<width, View>;
    /// A part has at most so many primitives; subtrees of fewer than `least` stay in the top.
    static constexpr std::uint32_t most = 8192, least = 64;
    struct Root {
        Ref ref;
        std::uint32_t depth;
        SearchOdds odds{};
    };
    /// Node `number` of the top, whose slots are filled when all below is known. A child that is
    /// another such node has its place here as `source`.
    struct TopNode {
        std::uint32_t number, depth, count;
        std::array<WideChild, width> children;
    };
    static constexpr std::uint32_t no_top_node = ~std::uint32_t{0};
    struct Waiting {
        Ref ref;
        std::uint32_t parent, child, depth;
    };

    /// From the first one on, each thread the next, so that few wait for their places.
    void write_parts(PartPlacer& placer) {
        std::atomic<std::size_t> next = 0;
        const ProgressCounter progress(static_cast<double>(roots_.size()));
        const auto threads = std::min(roots_.size(), static_cast<std::size_t>(thread_count()));
        for_each_index(
            threads,
            [&](std::size_t) {
                Collapse<width, View> collapse(view_, options_);
                for (std::size_t k = next++; k < roots_.size(); k = next++) {
                    std::unique_ptr<WidePart> part = placer.take();
                    collapse.plan(roots_[k].ref);
                    roots_[k].odds = collapse.odds(0);
                    Writer writer(view_, options_.compact, *part);
                    writer.write(collapse, roots_[k].depth);
                    writer.write_triangles();
                    placer.place(k, std::move(part));
                    try {
                        progress.add(1);
                    } catch (...) {
                        next = roots_.size();  // the other threads end too
                        throw;
                    }
                }
            },
            1);
    }

    void lay_out_top(WidePart& top) {
        Writer writer(view_, options_.compact, top);
        Collapse<width, View> small(view_, options_);
        std::vector<Waiting> waiting{{view_.root(), no_top_node, 0, 0}};
        std::array<Ref, width> chosen;
        while (!waiting.empty()) {
            const Waiting at = waiting.back();
            waiting.pop_back();
            const auto number = static_cast<std::uint32_t>(top_.size());
            TopNode node{writer.add_node(), at.depth, 0, {}};
            if (at.parent != no_top_node) {
                WideChild& place = top_[at.parent].children[at.child];
                place.word = node.number;
                place.source = number;
            }
            const std::size_t all = take_apart(at.ref, chosen);
            for (std::size_t k = 0; k < all; ++k) {
                const WideChild child = child_of(chosen[k], at.depth + 1, writer, small);
                if (child.word == wide_no_child) continue;
                if (child.word == WideChild::inner_word)
                    waiting.push_back({chosen[k], number, node.count, at.depth + 1});
                node.children[node.count++] = child;
            }
            top_.push_back(node);
        }
        writer.write_triangles();
    }

    /// Children come after their parents: from the last node to the first, all odds are known.
    void fill_top(WidePart& top) {
        Writer writer(view_, options_.compact, top);
        const double root = half_area(view_.box(view_.root()));
        std::vector<SearchOdds> odds(top_.size());
        for (std::size_t t = top_.size(); t-- > 0;) {
            TopNode& node = top_[t];
            const std::span children = std::span(node.children).first(node.count);
            Aabb box = empty_box();
            for (WideChild& child : children) {
                if (child.source != no_top_node) child.odds = odds[child.source];
                if (is_part(child.word)) child.odds = roots_[child.word & ~wide_part_bit].odds;
                box = unite(box, child.box);
            }
            const auto area = static_cast<float>(root > 0 ? half_area(box) / root : 0.0);
            odds[t] = odds_of_node(area);
            for (const WideChild& child : children) add_child(child.odds, area, odds[t]);
            writer.fill_node(node.number, children, node.depth,
                             [](std::uint32_t, std::uint32_t) {});
        }
    }

    static bool is_part(std::uint32_t word) {
        return (word & wide_leaf_bit) == 0 && (word & wide_part_bit) != 0;
    }

    /// Vertices get numbers in the order in which blocks name them, and those that none names none.
    void number_vertices(WideBvh::Arrays& out) const {
        std::vector<std::uint32_t> numbers(view_.vertex_count(), no_vertex), used;
        for (CompactBlock& block : out.compact_blocks.span())
            for (auto& corners : block.vertex)
                for (std::uint32_t& vertex : corners) {
                    if (vertex == no_vertex) {  // of an empty lane
                        vertex = 0;
                        continue;
                    }
                    if (numbers[vertex] == no_vertex) {
                        numbers[vertex] = static_cast<std::uint32_t>(used.size());
                        used.push_back(vertex);
                    }
                    vertex = numbers[vertex];
                }
        out.vertices.reset(used.size());
        prefer_large_pages(out.vertices);
        for_each_index(used.size(),
                       [&](std::size_t k) { out.vertices[k] = view_.vertex(used[k]); });
    }

    /// The children of a node of the top: the largest one is replaced by its own two while there is
    /// room.
    std::size_t take_apart(Ref ref, std::array<Ref, width>& chosen) const {
        std::array<double, width> area;
        std::size_t count = 0;
        const auto set = [&](std::size_t k, Ref child) {
            chosen[k] = child;
            const bool open = !view_.is_leaf(child) && view_.size(child) >= least;
            area[k] = open ? half_area(view_.box(child)) : -1.0;
        };
        for (const Ref child : view_.children(ref)) set(count++, child);
        while (count < width) {
            const auto largest = static_cast<std::size_t>(
                std::max_element(area.begin(), area.begin() + count) - area.begin());
            if (area[largest] < 0) break;
            const auto [a, b] = view_.children(chosen[largest]);
            set(largest, a);
            set(count++, b);
        }
        return count;
    }

    /// A child of the top, whose odds are known if it is a small subtree.
    WideChild child_of(Ref ref, std::uint32_t depth, Writer& writer, Collapse<width, View>& small) {
        WideChild child{view_.box(ref), WideChild::inner_word, no_top_node, {}};
        const std::uint32_t size = view_.is_leaf(ref) ? 1 : view_.size(ref);
        if (size > most) return child;
        if (size >= least) {
            roots_.push_back({ref, depth});
            child.word = wide_part_bit | static_cast<std::uint32_t>(roots_.size() - 1);
            return child;
        }
        small.plan(ref);
        child.odds = small.odds(0);
        child.word = small.is_leaf(0) ? writer.leaf_word(small, 0) : writer.write(small, depth);
        return child;
    }

    const View& view_;
    WideOptions options_;
    PartPool& pool_;
    std::vector<Root> roots_;
    std::vector<TopNode> top_;
};

}  // namespace raydix
