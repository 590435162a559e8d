// Parts of a wide tree come to the same places whatever the order in which they are finished, and
// whether the room that was guessed for them is too small or not.
#include "layout/wide_part.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "exec/parallel.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t wide_part_seed = 20170727;

/// `nodes` nodes, the first with a leaf, a node of the part and missing children; blocks of ids.
std::unique_ptr<WidePart> make_part(std::uint32_t k, std::uint32_t nodes, std::uint32_t blocks,
                                    bool compact) {
    auto part = std::make_unique<WidePart>();
    const auto fill = [&](auto& to) {
        to.resize(nodes);
        for (auto& node : to) {
            node = {};
            std::fill_n(node.child, quantised_width, wide_no_child);
            node.child[0] = wide_leaf_bit | (k % blocks) << 5 | 1;
            node.child[1] = nodes - 1;
        }
    };
    const auto number = [&](auto& to) {
        to.resize(blocks);
        for (auto& block : to) {
            block = {};
            block.prim[0] = k;
        }
    };
    compact ? fill(part->compact_nodes) : fill(part->nodes);
    compact ? number(part->compact_blocks) : number(part->blocks);
    for (std::uint32_t b = 0; b < blocks; ++b) part->filler.place(4);
    part->sums.leaves = 1;
    part->sums.node_area = 1.0 / (k + 3);
    return part;
}

struct Placed {
    std::vector<std::uint32_t> words, prims;
    double node_area = 0;
    friend bool operator==(const Placed&, const Placed&) = default;
};

template <class Nodes, class Blocks>
void read(const Nodes& nodes, const Blocks& blocks, Placed& placed) {
    for (const auto& node : nodes.view())
        placed.words.insert(placed.words.end(), node.child, node.child + quantised_width);
    for (const auto& block : blocks.view()) placed.prims.push_back(block.prim[0]);
}

constexpr std::uint32_t part_count = 50;
std::uint32_t nodes_of(std::uint32_t k) { return 1 + k * 7 % 11; }
std::uint32_t blocks_of(std::uint32_t k) { return 1 + k * 5 % 13; }

Placed place(const std::vector<std::uint32_t>& order, std::size_t references, bool compact,
             PartPool& pool, WideBvh::Arrays& out) {
    PartPlacer placer(compact, references, part_count, pool, out);
    std::unique_ptr<WidePart> top = take_part(pool);
    *top = std::move(*make_part(1000, part_count, 1, compact));
    const auto name = [&](auto& nodes) {
        for (std::uint32_t k = 0; k < nodes.size(); ++k) nodes[k].child[1] = wide_part_bit | k;
    };
    name(top->nodes);
    name(top->compact_nodes);
    placer.set_top(std::move(top));
    for (const std::uint32_t k : order) {
        // Its memory may have held another part before.
        std::unique_ptr<WidePart> part = placer.take();
        EXPECT_EQ(part->node_count(), 0u);
        *part = std::move(*make_part(k, nodes_of(k), blocks_of(k), compact));
        placer.place(k, std::move(part));
    }
    Placed placed;
    placed.node_area = placer.finish().node_area;
    compact ? read(out.compact_nodes, out.compact_blocks, placed)
            : read(out.nodes, out.blocks, placed);
    return placed;
}

/// What the arrays hold if parts are simply put behind each other.
Placed in_order() {
    Placed all;
    std::uint32_t node = part_count, block = 1;
    for (std::uint32_t k = 0; k < part_count; ++k) {
        all.words.insert(all.words.end(), {wide_leaf_bit | (1000 % 1) << 5 | 1, node});
        all.words.insert(all.words.end(), quantised_width - 2, wide_no_child);
        node += nodes_of(k);
    }
    all.prims.push_back(1000);
    all.node_area = 1.0 / 1003;
    node = part_count;
    for (std::uint32_t k = 0; k < part_count; ++k) {
        for (std::uint32_t i = 0; i < nodes_of(k); ++i) {
            const std::uint32_t place = (block + k % blocks_of(k)) << 5;
            all.words.insert(all.words.end(), {wide_leaf_bit | place | 1, node + nodes_of(k) - 1});
            all.words.insert(all.words.end(), quantised_width - 2, wide_no_child);
        }
        all.prims.insert(all.prims.end(), blocks_of(k), k);
        all.node_area += 1.0 / (k + 3);
        node += nodes_of(k);
        block += blocks_of(k);
    }
    return all;
}

TEST(PartPlacer, PutsPartsBehindEachOtherInAnyOrder) {
    const Placed expected = in_order();
    std::vector<std::uint32_t> order(part_count);
    std::iota(order.begin(), order.end(), 0);
    std::mt19937_64 random(wide_part_seed);
    for (const bool compact : {false, true})
        for (const std::size_t references : {0, 900, 100000}) {  // none, half, enough
            PartPool pool;
            WideBvh::Arrays out;
            for (int round = 0; round < 6; ++round) {
                SCOPED_TRACE("compact " + std::to_string(compact) + ", room for " +
                             std::to_string(references) + ", round " + std::to_string(round));
                EXPECT_EQ(place(order, references, compact, pool, out), expected);
                std::shuffle(order.begin(), order.end(), random);
            }
            EXPECT_LE(pool.size(), part_count + 1);  // kept for the next tree, not heaped up
        }
}

TEST(PartPlacer, TakesPartsFromSeveralThreads) {
    const Placed expected = in_order();
    for (const std::size_t references : {0, 900, 100000}) {
        PartPool pool;
        WideBvh::Arrays out;
        Placed placed;
        with_threads(7, [&] {
            PartPlacer placer(false, references, part_count, pool, out);
            auto top = make_part(1000, part_count, 1, false);
            for (std::uint32_t k = 0; k < part_count; ++k)
                top->nodes[k].child[1] = wide_part_bit | k;
            placer.set_top(std::move(top));
            for_each_index(
                part_count,
                [&](std::size_t at) {
                    const auto k = static_cast<std::uint32_t>(at);
                    placer.place(k, make_part(k, nodes_of(k), blocks_of(k), false));
                },
                1);
            placed.node_area = placer.finish().node_area;
        });
        read(out.nodes, out.blocks, placed);
        EXPECT_EQ(placed, expected);
    }
}

}  // namespace
}  // namespace raydix::test
