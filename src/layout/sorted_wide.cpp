// Sorted triangles -> a WideBvh. Its top is known from the prefixes; the parts below are counted,
// then written, each by one thread, blocks where they stay and nodes put behind each other; last
// the top gets its boxes. The arrays do not depend on the number of threads.
#include <raydix/error.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <memory>

#include "exec/large_pages.h"
#include "exec/parallel.h"
#include "exec/progress.h"
#include "layout/about_middle.h"
#include "layout/wide_scratch.h"
#include "tree/kept_splits.h"

namespace raydix {
namespace {

/// Calls take(count) for the leaves of keys [begin, end), from left to right.
template <class Take>
void for_each_leaf(const std::uint64_t* kept, std::uint32_t begin, std::uint32_t end,
                   const Take& take) {
    std::uint32_t first = begin;
    for (std::uint32_t w = begin / word_bits; w * word_bits < end; ++w) {
        std::uint64_t word = kept[w];
        if (w == begin / word_bits) word &= ~std::uint64_t{0} << begin % word_bits;
        for (; word != 0; word &= word - 1) {
            const auto split = static_cast<std::uint32_t>(w * word_bits) +
                               static_cast<std::uint32_t>(std::countr_zero(word));
            if (split + 1 >= end) break;
            take(split + 1 - first);
            first = split + 1;
        }
    }
    take(end - first);
}

template <int width>
class SortedEmitter {
public:
    SortedEmitter(const SortedTriangles& triangles, const WideOptions& options,
                  WideScratch::Memory& memory)
        : triangles_(triangles), options_(options), memory_(memory), scratch_(memory.sorted) {}

    void run(WideBvh::Arrays& out) {
        const NeighbourPrefixes& prefixes = triangles_.prefixes;
        mark_kept_splits(prefixes, prefixes.count() - 1, static_cast<int>(options_.max_leaf),
                         scratch_.kept_bits, scratch_.kept_before);
        top_ = make_sorted_top(triangles_, width, options_.max_leaf, scratch_.top);
        make_groups();
        const std::size_t blocks = count_blocks();
        PartPlacer placer(PartRoom{prefixes.count(), groups_.size(), blocks}, memory_.pool, out);
        std::unique_ptr<WidePart> top = take_part(memory_.pool);
        top->nodes.resize(top_.nodes.size());
        WidePart& top_part = *top;
        placer.set_top(std::move(top));
        write_groups(placer, out);
        write_top(placer, center_of(triangles_.bounds), top_part);
        const WideSums sums = placer.finish();
        set_tree_figures(sums, triangles_.bounds, center_of(triangles_.bounds), out);
    }

private:
    /// Parts [begin, end): one, or several of so many keys at most.
    static constexpr std::uint32_t most_in_group = 4096;
    struct Group {
        std::size_t begin, end;
        std::size_t first_block = 0;
    };

    void make_groups() {
        const std::vector<SortedPart>& parts = top_.parts;
        for (std::size_t p = 0; p < parts.size(); ++p) {
            if (groups_.empty() || parts[p].end - parts[groups_.back().begin].begin > most_in_group)
                groups_.push_back({p, p});
            groups_.back().end = p + 1;
        }
    }

    /// Where the blocks of each group begin; returns how many there are.
    std::size_t count_blocks() {
        for_each_index(
            groups_.size(),
            [&](std::size_t g) {
                Group& group = groups_[g];
                BlockFiller filler;
                for (std::size_t p = group.begin; p < group.end; ++p)
                    for_each_leaf(scratch_.kept_bits.data(), top_.parts[p].begin, top_.parts[p].end,
                                  [&](std::uint32_t count) { filler.place(count); });
                group.first_block = filler.blocks();
            },
            1);
        std::size_t sum = 0;
        for (Group& group : groups_) sum += std::exchange(group.first_block, sum);
        return sum;
    }

    /// From the first one on, each thread the next, so that few wait for their places.
    void write_groups(PartPlacer& placer, WideBvh::Arrays& out) {
        const PartKernel& kernel = part_kernels().front();
        const ProgressCounter progress(static_cast<double>(triangles_.order.size()));
        const PartInput in{triangles_, scratch_.kept_bits.data(), center_of(triangles_.bounds),
                           progress};
        scratch_.roots.resize(top_.parts.size());
        const auto threads = std::min(groups_.size(), static_cast<std::size_t>(thread_count()));
        auto& entries = entries_of(scratch_);
        if (entries.size() < threads) entries.resize(threads);
        std::atomic<std::size_t> next = 0;
        for_each_index(
            threads,
            [&](std::size_t thread) {
                const LargePages large;  // of the other threads too
                try {
                    for (std::size_t g = next++; g < groups_.size(); g = next++) {
                        const Group& group = groups_[g];
                        const std::size_t count = group.end - group.begin;
                        std::unique_ptr<WidePart> part = placer.take();
                        const PartGroup work{std::span(top_.parts).subspan(group.begin, count),
                                             std::span(scratch_.roots).subspan(group.begin, count),
                                             out.blocks.data() + group.first_block};
                        write_of(kernel)(in, work, entries[thread], *part);
                        placer.place(g, std::move(part));
                    }
                } catch (...) {
                    next = groups_.size();  // the other threads end too
                    throw;
                }
            },
            1);
    }
    static auto write_of(const PartKernel& kernel) {
        if constexpr (width == 4)
            return kernel.write4;
        else
            return kernel.write8;
    }
    static auto& entries_of(SortedScratch& scratch) {
        if constexpr (width == 4)
            return scratch.entries4;
        else
            return scratch.entries8;
    }

    /// Children come after their parents: from the last node to the first, all boxes are known.
    void write_top(const PartPlacer& placer, Vec3 middle, WidePart& out) {
        std::vector<std::array<PartRoot, width>> slots(top_.nodes.size());
        for (std::size_t g = 0; g < groups_.size(); ++g)
            for (std::size_t p = groups_[g].begin; p < groups_[g].end; ++p) {
                const TopSlot at = top_.parts[p].parent;
                if (at.node == TopSlot::no_node) continue;
                PartRoot root = scratch_.roots[p];
                root.word += static_cast<std::uint32_t>(
                    (root.word & wide_leaf_bit) != 0 ? groups_[g].first_block * block_lanes << 3
                                                     : placer.first_node(g));
                slots[at.node][at.child] = root;
            }
        for (std::size_t w = top_.nodes.size(); w-- > 0;) {
            const SortedTop::Node& node = top_.nodes[w];
            const std::span<PartRoot> children = std::span(slots[w]).first(node.children);
            const PartRoot root = write_top_node(children, middle, out.nodes[w], out.sums);
            out.sums.levels = std::max(out.sums.levels, node.depth + 1);
            if (node.parent.node == TopSlot::no_node) continue;
            slots[node.parent.node][node.parent.child] = root;
            slots[node.parent.node][node.parent.child].word = static_cast<std::uint32_t>(w);
        }
    }

    static PartRoot write_top_node(std::span<PartRoot> children, Vec3 middle, WideNode& node,
                                   WideSums& sums) {
        std::ranges::stable_sort(children, {},
                                 [](const PartRoot& root) { return search_rank(root.odds); });
        SlotBoxes boxes{};
        std::fill_n(node.child, quantised_width, wide_no_child);
        PartRoot all{empty_box()};
        for (std::size_t s = 0; s < children.size(); ++s) {
            const PartRoot& child = children[s];
            all.box = unite(all.box, child.box);
            boxes.set(static_cast<int>(s), child.box);
            node.child[s] = child.word;
            if ((child.word & wide_leaf_bit) == 0) continue;
            const std::uint32_t triangles = (child.word & 7) + 1;
            ++sums.leaves;
            sums.references += triangles;
            sums.triangle_area += half_area(child.box) * triangles;
        }
        set_boxes_about(middle, boxes, node);
        const double area = half_area(all.box);
        all.odds = odds_of_node(static_cast<float>(area));
        for (const PartRoot& child : children)
            add_child(child.odds, static_cast<float>(area), all.odds);
        sums.children += children.size();
        sums.node_area += area;
        return all;
    }

    const SortedTriangles& triangles_;
    const WideOptions& options_;
    WideScratch::Memory& memory_;
    SortedScratch& scratch_;
    SortedTop top_;
    std::vector<Group> groups_;
};

}  // namespace

std::span<std::byte> memory_for_sorting(std::size_t triangles, std::size_t bytes,
                                        WideBvh::Arrays& out) {
    const std::size_t blocks = std::max(
        guessed_blocks(triangles), (bytes + sizeof(TriangleBlock) - 1) / sizeof(TriangleBlock));
    out.blocks.reset(blocks);
    prefer_large_pages(out.blocks);
    return std::as_writable_bytes(out.blocks.span());
}

void make_wide_layout(const SortedTriangles& triangles, const WideOptions& options,
                      WideBvh::Arrays& out, WideScratch& scratch) {
    if (options.width == 4)
        SortedEmitter<4>(triangles, options, *scratch.memory).run(out);
    else
        SortedEmitter<8>(triangles, options, *scratch.memory).run(out);
}

}  // namespace raydix
