// The collapse against a search through all cuts of small trees; and for trees of any kind: every
// primitive once, boxes within boxes, exact depth, the same tree for every thread count.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/raydix.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/math.h"
#include "exec/parallel.h"
#include "layout/wide_collapse.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

Aabb box_of(const BvhNode& n) { return {n.lo, n.hi}; }

bool contains(const Aabb& a, const Aabb& b) {
    return a.lo.x <= b.lo.x && a.lo.y <= b.lo.y && a.lo.z <= b.lo.z && a.hi.x >= b.hi.x &&
           a.hi.y >= b.hi.y && a.hi.z >= b.hi.z;
}

/// The least cost by the definition: a node's children may be any cut through its subtree of up to
/// `width` nodes. Exponential.
class CutSearch {
public:
    CutSearch(std::span<const BvhNode> nodes, const WideOptions& options)
        : nodes_(nodes), options_(options) {}
    double root() const { return as_node(0) / half_area(box_of(nodes_[0])); }

private:
    struct Cut {
        std::size_t size;
        double cost;
    };
    std::uint32_t count(std::uint32_t slot) const {
        const BvhNode& n = nodes_[slot];
        return n.is_leaf() ? n.count : count(n.first) + count(n.first + 1);
    }
    double as_leaf(std::uint32_t slot) const {
        const std::uint32_t blocks = (count(slot) + options_.block - 1) / options_.block;
        return count(slot) <= options_.max_leaf
                   ? blocks * half_area(box_of(nodes_[slot])) * options_.primitive_cost
                   : INFINITY;
    }
    double as_node(std::uint32_t slot) const {
        double best = as_leaf(slot);  // the only child of a node
        if (!nodes_[slot].is_leaf())
            for (const Cut& cut : cuts_below(slot)) best = std::min(best, cut.cost);
        return best + half_area(box_of(nodes_[slot])) * options_.node_cost;
    }
    double best_of(std::uint32_t slot) const {
        return nodes_[slot].is_leaf() ? as_leaf(slot) : std::min(as_leaf(slot), as_node(slot));
    }
    std::vector<Cut> cuts_below(std::uint32_t slot) const {
        std::vector<Cut> all;
        const BvhNode& n = nodes_[slot];
        for (const Cut& a : cuts(n.first))
            for (const Cut& b : cuts(n.first + 1))
                if (a.size + b.size <= static_cast<std::size_t>(options_.width))
                    all.push_back({a.size + b.size, a.cost + b.cost});
        return all;
    }
    std::vector<Cut> cuts(std::uint32_t slot) const {
        std::vector<Cut> all{{1, best_of(slot)}};
        if (!nodes_[slot].is_leaf())
            for (const Cut& cut : cuts_below(slot)) all.push_back(cut);
        return all;
    }
    std::span<const BvhNode> nodes_;
    WideOptions options_;
};

/// Depth below node w; counts how often each position is in a leaf.
std::uint32_t walk(const WideTree& tree, std::uint32_t w, const WideOptions& options,
                   const Bvh& bvh, std::vector<int>& seen) {
    std::uint32_t deepest = 0, next_inner = 0;
    bool ended = false;
    for (const BvhNode& child : tree.node(w)) {
        if (WideTree::is_unused(child)) {
            ended = true;
            continue;
        }
        EXPECT_FALSE(ended) << "a child behind an unused place of node " << w;
        std::uint32_t below = 0;
        if (WideTree::is_inner(child)) {
            EXPECT_GT(child.first, w);
            if (next_inner != 0) {
                EXPECT_EQ(child.first, next_inner);
            }
            next_inner = child.first + 1;
            for (const BvhNode& grandchild : tree.node(child.first))
                EXPECT_TRUE(WideTree::is_unused(grandchild) ||
                            contains(box_of(child), box_of(grandchild)));
            below = walk(tree, child.first, options, bvh, seen);
        } else {
            EXPECT_LE(child.count, options.max_leaf);
            for (std::uint32_t k = child.first; k < child.first + child.count; ++k) {
                ++seen.at(k);
                const LeafTriangle& t = bvh.triangles()[k];
                EXPECT_TRUE(contains(box_of(child), raydix::box_of(t.v0, t.v1, t.v2)));
            }
        }
        deepest = std::max(deepest, below + 1);
    }
    return deepest;
}

void expect_valid(const Bvh& bvh, const WideOptions& options) {
    SCOPED_TRACE(std::to_string(bvh.order().size()) + " references, width " +
                 std::to_string(options.width) + ", leaves of " + std::to_string(options.max_leaf));
    const WideTree tree = collapse_to_wide(bvh, options);
    std::vector<int> seen(bvh.order().size());
    ASSERT_EQ(tree.node_count() == 0, bvh.empty());
    if (!bvh.empty()) {
        EXPECT_EQ(walk(tree, 0, options, bvh, seen), tree.max_depth);
    }
    EXPECT_TRUE(std::ranges::all_of(seen, [](int times) { return times == 1; }));
}

constexpr WideOptions kinds[] = {{4, 1, 1, 1},      {4, 3, 1, 1},   {4, 8, 1, 1},   {8, 1, 1, 1},
                                 {8, 3, 1, 1},      {8, 3, 2, 1},   {8, 255, 1, 1}, {4, 4, 1, 1, 4},
                                 {8, 4, 1, 0.4, 4}, {8, 5, 1, 1, 2}};

TEST(WideCollapse, CostsTheLeastOfAllCuts) {
    for (std::size_t n = 1; n <= 11; ++n)
        for (std::uint64_t seed = 1; seed <= 12; ++seed) {
            // Apart, or over each other: then a leaf of two is cheaper than two leaves of one.
            const Mesh mesh = random_soup(n, seed, seed % 2 == 0 ? 0.3f : 3.0f);
            for (const int leaf : {1, 2}) {
                const Bvh bvh = build_bvh(mesh, {.max_leaf = leaf});
                for (WideOptions options : kinds) {
                    options.max_leaf = std::max(options.max_leaf, 2u);
                    const WideTree tree = collapse_to_wide(bvh, options);
                    const double wanted = CutSearch(bvh.nodes(), options).root();
                    EXPECT_NEAR(wide_cost(tree, options) * options.node_cost, wanted, 1e-5 * wanted)
                        << n << " triangles, seed " << seed << ", width " << options.width
                        << ", leaves of " << options.max_leaf;
                }
            }
        }
}

TEST(WideCollapse, HoldsEveryPrimitiveOnce) {
    for (const WideOptions& options : kinds) {
        for (std::size_t n = 0; n <= 20; ++n)
            expect_valid(build_bvh(random_soup(n, n + 1), {.max_leaf = 4}), options);
        for (const Builder builder : {Builder::karras, Builder::ploc, Builder::binned})
            for (const int leaf : {1, 4, 255})
                expect_valid(
                    build_bvh(random_soup(3000, 5), {.builder = builder, .max_leaf = leaf}),
                    options);
        expect_valid(build_bvh(lattice_mesh(2000, 6, 3)), options);
    }
}

/// Without area every tree costs 0: what is left is to stay shallow.
TEST(WideCollapse, EqualAndFlatTrianglesGiveAShallowTree) {
    Mesh mesh;
    mesh.vertices = {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}};
    mesh.triangles.assign(4096, {0, 1, 2});
    const Bvh bvh = build_bvh(mesh, {.max_leaf = 1});
    for (const int width : {4, 8}) {
        const WideOptions options{.width = width, .max_leaf = 1};
        expect_valid(bvh, options);
        const WideTree tree = collapse_to_wide(bvh, options);
        EXPECT_LE(tree.max_depth, width == 4 ? 6u : 4u);
        EXPECT_EQ(wide_cost(tree, options), 0.0);
    }
}

/// A chain: each split takes one triangle off.
TEST(WideCollapse, DeepTreesNeedNoRecursion) {
    Mesh mesh;
    for (int k = 0; k < (sanitized ? 300 : 900); ++k) {
        const float x = std::ldexp(1.0f, k / 20 - 40) * (1.0f + float(k % 20) / 20);
        const auto v = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.insert(mesh.vertices.end(), {{0, 0, 0}, {x, 0, 0}, {0, x, x}});
        mesh.triangles.push_back({v, v + 1, v + 2});
    }
    for (const Builder builder : {Builder::karras, Builder::ploc, Builder::binned})
        for (const WideOptions& options : kinds)
            expect_valid(build_bvh(mesh, {.builder = builder, .max_leaf = 1}), options);
}

TEST(WideCollapse, SameTreeForEveryThreadCount) {
    const Bvh bvh = build_bvh(load_model("builtin:atrium?triangles=20000").mesh());
    for (const int width : {4, 8}) {
        const WideOptions options{.width = width};
        const auto tree_with = [&](int threads) {
            WideTree tree;
            with_threads(threads, [&] { tree = collapse_to_wide(bvh, options); });
            return tree;
        };
        const WideTree one = tree_with(1);
        for (const int threads : {2, 5, 0}) {
            const WideTree other = tree_with(threads);
            ASSERT_EQ(one.children.size(), other.children.size());
            EXPECT_EQ(0, std::memcmp(one.children.data(), other.children.data(),
                                     one.children.size() * sizeof(BvhNode)));
        }
    }
}

TEST(WideCollapse, WiderTreesCostLessAndHoldFewerNodes) {
    const Bvh bvh = build_bvh(load_model("builtin:grove?triangles=20000").mesh(), {.max_leaf = 1});
    const WideOptions four{.width = 4}, eight{.width = 8};
    const WideTree tree4 = collapse_to_wide(bvh, four), tree8 = collapse_to_wide(bvh, eight);
    EXPECT_LT(tree8.node_count(), tree4.node_count());
    EXPECT_LT(wide_cost(tree8, eight), wide_cost(tree4, four));
    EXPECT_LT(tree8.max_depth, tree4.max_depth);
}

TEST(WideCollapse, RefusesOtherWidths) {
    const Bvh bvh = build_bvh(random_soup(10, 1));
    EXPECT_THROW((void)collapse_to_wide(bvh, {.width = 9}), InputError);
    EXPECT_THROW((void)collapse_to_wide(bvh, {.width = 1}), InputError);
    EXPECT_THROW((void)collapse_to_wide(bvh, {.width = 8, .max_leaf = 0}), InputError);
}

}  // namespace
}  // namespace raydix::test
