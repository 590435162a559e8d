// Reinsertion: the best place against trying all of them, what a round must leave as it is, and
// trees that no builder would make.
#include "tree/reinsertion.h"

#include <gtest/gtest.h>
#include <raydix/model.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "exec/parallel.h"
#include "support/sanitized.h"
#include "support/support.h"
#include "tree/cluster_cases.h"
#include "tree/reinsert_top.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t reinsertion_seed = 20130601;
using Nodes = std::vector<BvhNode>;

Nodes nodes_of(const Bvh& bvh) { return {bvh.nodes().begin(), bvh.nodes().end()}; }

std::vector<std::uint32_t> parents_of(const Nodes& nodes) {
    std::vector<std::uint32_t> parents(nodes.size() / 2);
    for (std::uint32_t slot = 0; slot < nodes.size(); ++slot)
        if (slot != 1 && !nodes[slot].is_leaf()) parents[nodes[slot].first / 2] = slot;
    return parents;
}

/// Slots from the root, parents before children; empty if a slot is met twice or the links leave
/// the tree.
std::vector<std::uint32_t> walk(const Nodes& nodes) {
    std::vector<std::uint32_t> slots{0};
    std::vector<bool> met(nodes.size());
    for (std::size_t next = 0; next < slots.size(); ++next) {
        const BvhNode& node = nodes[slots[next]];
        if (met[slots[next]]) return {};
        met[slots[next]] = true;
        if (node.is_leaf()) continue;
        if (node.first < 2 || node.first % 2 != 0 || node.first + 1 >= nodes.size()) return {};
        slots.push_back(node.first);
        slots.push_back(node.first + 1);
    }
    return slots;
}

void fit(Nodes& nodes) {
    const std::vector<std::uint32_t> slots = walk(nodes);
    for (std::size_t k = slots.size(); k-- > 0;) {
        BvhNode& node = nodes[slots[k]];
        if (node.is_leaf()) continue;
        const BvhNode &a = nodes[node.first], &b = nodes[node.first + 1];
        const Aabb box = unite({a.lo, a.hi}, {b.lo, b.hi});
        node.lo = box.lo;
        node.hi = box.hi;
    }
}

double inner_area(const Nodes& nodes) {
    double sum = 0;
    for (const std::uint32_t slot : walk(nodes))
        if (!nodes[slot].is_leaf()) sum += half_area({nodes[slot].lo, nodes[slot].hi});
    return sum;
}

/// Leaves as bytes, in an order of their own.
std::vector<std::string> leaves_of(const Nodes& nodes) {
    std::vector<std::string> leaves;
    for (const std::uint32_t slot : walk(nodes))
        if (nodes[slot].is_leaf())
            leaves.emplace_back(reinterpret_cast<const char*>(&nodes[slot]), sizeof(BvhNode));
    std::sort(leaves.begin(), leaves.end());
    return leaves;
}

void expect_better(const Nodes& before, const Nodes& after, const std::string& what) {
    ASSERT_EQ(walk(after).size(), after.size() - 1) << what;
    EXPECT_EQ(leaves_of(after), leaves_of(before)) << what;
    Nodes fitted = after;
    fit(fitted);
    EXPECT_EQ(std::memcmp(fitted.data(), after.data(), after.size() * sizeof(BvhNode)), 0) << what;
    EXPECT_LE(inner_area(after), inner_area(before) * (1 + 1e-12)) << what;
}

ReinsertionOptions all_nodes(int rounds) {
    return {.rounds = rounds, .part = 1.0, .least_gain = 0, .most_visits = 1u << 20};
}

TEST(InsertionSearch, FindsTheBestOfAllPlaces) {
    int moved = 0;
    for (const std::size_t n : {3, 4, 5, 9, 40}) {
        SCOPED_TRACE(std::to_string(n) + " triangles, seed " +
                     std::to_string(reinsertion_seed + n));
        Nodes nodes =
            nodes_of(build_bvh(random_soup(n, reinsertion_seed + n, 0.5f), {.max_leaf = 1}));
        std::vector<std::uint32_t> parents = parents_of(nodes);
        const double area = inner_area(nodes), root = half_area({nodes[0].lo, nodes[0].hi});
        InsertionSearch search({nodes.data(), parents.data()}, 1u << 20);
        for (std::uint32_t from = 2; from < nodes.size(); ++from) {
            const Insertion found = search.find(from);
            double best = 0, of_found = 0;
            for (std::uint32_t to = 0; to < nodes.size(); ++to) {
                if (to == 1 || to == from || to == (from ^ 1) || to == parents[from / 2]) continue;
                Nodes tried = nodes;
                std::vector<std::uint32_t> links = parents;
                Insertion move{from, to};
                LinkedTree{tried.data(), links.data()}.insert(move);
                if (walk(tried).size() != tried.size() - 1) continue;  // below itself
                fit(tried);
                const double gain = area - inner_area(tried);
                best = std::max(best, gain);
                if (to == found.to) of_found = gain;
            }
            if (found.to == Insertion::nowhere) {
                EXPECT_LE(best, 1e-4 * root) << from;
                continue;
            }
            ++moved;
            EXPECT_NEAR(of_found, best, 1e-5 * root) << from;
            EXPECT_NEAR(double(found.gain), best, 1e-5 * root) << from;
        }
    }
    EXPECT_GT(moved, 20);
}

TEST(InsertionSearch, WhatIsInsertedCanBeTakenBack) {
    const Nodes before =
        nodes_of(build_bvh(random_soup(300, reinsertion_seed, 0.2f), {.max_leaf = 1}));
    const std::vector<std::uint32_t> parents = parents_of(before);
    int moved = 0;
    for (std::uint32_t from = 2; from < before.size(); ++from) {
        Nodes nodes = before;
        std::vector<std::uint32_t> links = parents;
        const LinkedTree tree{nodes.data(), links.data()};
        Insertion move = InsertionSearch(tree, 1u << 20).find(from);
        if (move.to == Insertion::nowhere) continue;
        ++moved;
        tree.insert(move);
        EXPECT_EQ(links, parents_of(nodes));
        EXPECT_EQ(walk(nodes).size(), nodes.size() - 1);
        tree.take_back(move);
        EXPECT_EQ(links, parents);
        fit(nodes);
        EXPECT_EQ(std::memcmp(nodes.data(), before.data(), nodes.size() * sizeof(BvhNode)), 0);
    }
    EXPECT_GT(moved, 50);
}

TEST(Reinsertion, KeepsTheLeavesAndNeverGrowsTheArea) {
    ReinsertionScratch scratch;  // of all trees, one after the other
    for (const BoxInput& input : cluster_inputs(reinsertion_seed))
        for (const int max_leaf : {1, 4}) {
            const Bvh bvh = build_bvh(input.boxes, {.max_leaf = max_leaf});
            if (bvh.empty()) continue;
            const Nodes before = nodes_of(bvh);
            Nodes after = before;
            reinsert_nodes(after, all_nodes(4), scratch);
            expect_better(before, after, input.name + ", leaves of " + std::to_string(max_leaf));
        }
}

TEST(Reinsertion, GainsWhereCodesDividedBadly) {
    const Nodes before =
        nodes_of(build_bvh(random_soup(3000, reinsertion_seed, 0.3f), {.max_leaf = 1}));
    ReinsertionScratch scratch;
    Nodes once = before, often = before;
    const ReinsertionResult first = reinsert_nodes(once, all_nodes(1), scratch);
    const ReinsertionResult result = reinsert_nodes(often, all_nodes(8), scratch);
    EXPECT_EQ(first.rounds, 1);
    EXPECT_GT(result.moves, first.moves);
    EXPECT_LT(inner_area(once), 0.98 * inner_area(before));
    EXPECT_LT(inner_area(often), inner_area(once));
}

TEST(Reinsertion, IsTheSameForEveryNumberOfThreads) {
    const Nodes before =
        nodes_of(build_bvh(random_soup(fewer(20'000, 4), reinsertion_seed, 0.1f), {.max_leaf = 1}));
    Nodes one = before;
    with_threads(1, [&] {
        ReinsertionScratch scratch;
        EXPECT_GT(reinsert_nodes(one, all_nodes(3), scratch).moves, 1000u);
    });
    for (const int threads : {2, 8}) {
        Nodes other = before;
        with_threads(threads, [&] {
            ReinsertionScratch scratch;
            reinsert_nodes(other, all_nodes(3), scratch);
        });
        EXPECT_EQ(std::memcmp(one.data(), other.data(), one.size() * sizeof(BvhNode)), 0)
            << threads << " threads";
    }
}

/// Leaf i hangs beside all that come after it: as deep as a tree can be.
Nodes chain(std::size_t leaves) {
    std::mt19937_64 random(reinsertion_seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    Nodes nodes(2 * leaves);
    for (std::size_t i = 0; i < leaves; ++i) {
        const Vec3 p{unit(), unit(), unit()};
        const BvhNode leaf{p, static_cast<std::uint32_t>(i), p + Vec3{0.01f, 0.01f, 0.01f}, 1};
        const std::size_t above = i < 2 ? 0 : 2 * i - 1;  // holds leaf i and the rest
        if (i + 1 < leaves) {
            nodes[above == 0 ? 0 : above].first = static_cast<std::uint32_t>(2 * i + 2);
            nodes[2 * i + 2] = leaf;
        } else {
            nodes[2 * i + 1] = leaf;
        }
    }
    // The node over leaf i stands beside leaf i - 1.
    for (std::size_t i = 1; i + 1 < leaves; ++i)
        nodes[2 * i + 1].first = static_cast<std::uint32_t>(2 * i + 2);
    nodes[0].first = 2;
    fit(nodes);
    return nodes;
}

TEST(Reinsertion, ADeepChainTakesNoStackAndGetsShorter) {
    const Nodes before = chain(sanitized ? 6'000 : thorough > 1 ? 100'000 : 20'000);
    ASSERT_EQ(walk(before).size(), before.size() - 1);
    Nodes after = before;
    ReinsertionScratch scratch;
    const ReinsertionOptions options{.rounds = 2, .part = 0.01, .most_visits = 1024};
    EXPECT_GT(reinsert_nodes(after, options, scratch).moves, 0u);
    EXPECT_EQ(walk(after).size(), after.size() - 1);
    EXPECT_LT(inner_area(after), inner_area(before));
}

TEST(Reinsertion, BoxesWithoutAreaStay) {
    const std::vector<Aabb> points(5000, {{1, 2, 3}, {1, 2, 3}});
    Nodes nodes = nodes_of(build_bvh(points, {.max_leaf = 1}));
    const Nodes before = nodes;
    ReinsertionScratch scratch;
    EXPECT_EQ(reinsert_nodes(nodes, all_nodes(2), scratch).moves, 0u);
    EXPECT_EQ(std::memcmp(nodes.data(), before.data(), nodes.size() * sizeof(BvhNode)), 0);
}

/// Areas that are infinite, or not a number, gain nothing that could be compared.
TEST(Reinsertion, BoxesBeyondAllAreasLeaveATree) {
    constexpr float huge = std::numeric_limits<float>::max();
    Nodes nodes = nodes_of(build_bvh(random_soup(100, reinsertion_seed), {.max_leaf = 1}));
    for (std::uint32_t slot = 2; slot < nodes.size(); slot += 7)
        if (nodes[slot].is_leaf()) nodes[slot].hi = {huge, huge, huge};
    for (std::uint32_t slot = 3; slot < nodes.size(); slot += 16)
        if (nodes[slot].is_leaf()) nodes[slot].lo.x = -std::numeric_limits<float>::infinity();
    fit(nodes);
    const std::vector<std::string> leaves = leaves_of(nodes);
    ReinsertionScratch scratch;
    reinsert_nodes(nodes, all_nodes(3), scratch);
    EXPECT_EQ(walk(nodes).size(), nodes.size() - 1);
    EXPECT_EQ(leaves_of(nodes), leaves);
}

TEST(TopTree, IsTheNodesOfTheLargestAreas) {
    const Bvh bvh = build_bvh(random_soup(3000, reinsertion_seed, 0.1f));
    const TopOptions whole{.reinsertion = all_nodes(0), .part = 1.0};
    Buffer<BvhNode> nodes(bvh.nodes().size());
    std::copy(bvh.nodes().begin(), bvh.nodes().end(), nodes.data());
    Buffer<std::uint32_t> order(bvh.order().size());
    std::copy(bvh.order().begin(), bvh.order().end(), order.data());
    TopScratch scratch;
    std::uint32_t depth = bvh.max_depth();
    EXPECT_FALSE(reinsert_finished(nodes, order, depth, whole, scratch));
    EXPECT_EQ(scratch.top.inner.size(), bvh.inner_count());

    TopOptions small = whole;
    small.part = 0.1;
    small.least = 1;
    EXPECT_FALSE(reinsert_finished(nodes, order, depth, small, scratch));
    EXPECT_EQ(scratch.top.inner.size(), bvh.inner_count() / 10);
    EXPECT_EQ(walk(scratch.top.nodes).size(), scratch.top.nodes.size() - 1);
    // No node outside is larger than one inside, by more than a bin is wide.
    std::vector<bool> inside(nodes.size());
    float least = infinity;
    for (const std::uint32_t slot : scratch.top.inner) {
        inside[slot] = true;
        least = std::min(least, cluster_area({nodes[slot].lo, nodes[slot].hi}));
    }
    for (std::size_t slot = 0; slot < nodes.size(); ++slot) {
        if (inside[slot] || nodes[slot].is_leaf()) continue;
        EXPECT_LE(cluster_area({nodes[slot].lo, nodes[slot].hi}), least * (1 + 1.0f / 16));
    }
}

}  // namespace
}  // namespace raydix::test
