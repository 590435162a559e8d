// The bottom-up pass over runs of positions against the definition of the tree, and against itself
// with other runs.
#include "tree/apetrei_cpu.h"
#include "support/sanitized.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <iostream>
#include <random>
#include <vector>

#include "base/math.h"
#include "exec/parallel.h"

namespace raydix::test {
namespace {

using Random = std::mt19937_64;

/// Sorted keys: `distinct` of them, each once or more.
template <class Key>
std::vector<Key> sorted_keys(std::size_t n, std::size_t distinct, int low_bits, Random& random) {
    std::vector<Key> values(distinct);
    for (Key& v : values) v = static_cast<Key>(random() & ((std::uint64_t{1} << low_bits) - 1));
    std::vector<Key> keys(n);
    for (Key& k : keys) k = values[random() % distinct];
    std::ranges::sort(keys);
    return keys;
}

Aabb box_at(std::size_t k) {
    Random random(k);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    const Vec3 lo{unit(), unit(), unit()};
    return {lo, lo + Vec3{unit(), unit(), unit()}};
}

/// The tree by definition: a range splits where the common prefix of neighbours is shortest.
template <class Key>
struct Expected {
    const SortedKeys<Key> keys;
    std::uint32_t max_leaf;
    std::span<const BvhNode> nodes;
    std::uint32_t inner = 0, max_depth = 0;

    Aabb check(std::uint32_t slot, std::uint32_t first, std::uint32_t last, std::uint32_t depth) {
        const BvhNode& node = nodes[slot];
        max_depth = std::max(max_depth, depth);
        Aabb box = empty_box();
        if (last - first + 1 <= max_leaf) {
            EXPECT_EQ(node.first, first);
            EXPECT_EQ(node.count, last - first + 1);
            for (std::uint32_t k = first; k <= last; ++k) box = unite(box, box_at(k));
        } else {
            std::uint32_t split = first;
            for (std::uint32_t k = first; k < last; ++k)
                if (keys.common_prefix(k, k + 1) < keys.common_prefix(split, split + 1)) split = k;
            EXPECT_EQ(node.count, 0u);
            ++inner;
            if (node.count != 0 || ::testing::Test::HasFailure()) return box;
            box = unite(check(node.first, first, split, depth + 1),
                        check(node.first + 1, split + 1, last, depth + 1));
        }
        EXPECT_EQ(node.lo, box.lo);
        EXPECT_EQ(node.hi, box.hi);
        return box;
    }
};

struct Built {
    Buffer<BvhNode> nodes;
    ApetreiTree tree;
};

template <class Key>
Built build(const std::vector<Key>& keys, int max_leaf, std::size_t run_length) {
    ClimbScratch scratch;
    Built built;
    const NeighbourPrefixes prefixes(
        SortedKeys<Key>{keys.data(), static_cast<std::uint32_t>(keys.size())}, scratch.prefixes);
    std::vector<std::atomic<int>> asked(keys.size());
    const auto leaf_box = [&](std::size_t k) {
        ++asked[k];
        return Box3::load(box_at(k));
    };
    built.tree = build_apetrei_cpu(prefixes, max_leaf, leaf_box, built.nodes, scratch, run_length);
    for (std::size_t k = 0; k < keys.size(); ++k) EXPECT_EQ(asked[k], 1) << k;
    return built;
}

template <class Key>
void expect_right(const std::vector<Key>& keys) {
    for (const int max_leaf : {1, 2, 3, 4, 17, 64, 255}) {
        if (sanitized && (max_leaf == 2 || max_leaf == 64)) continue;
        if (keys.size() <= static_cast<std::size_t>(max_leaf)) continue;
        SCOPED_TRACE("n " + std::to_string(keys.size()) + ", max_leaf " + std::to_string(max_leaf));
        const Built whole = build(keys, max_leaf, keys.size());
        const auto n = static_cast<std::uint32_t>(keys.size());
        Expected<Key> expected{
            {keys.data(), n}, static_cast<std::uint32_t>(max_leaf), whole.nodes.view()};
        expected.check(0, 0, n - 1, 0);
        EXPECT_EQ(whole.tree.inner, expected.inner);
        EXPECT_EQ(whole.tree.max_depth, expected.max_depth);
        EXPECT_EQ(whole.nodes.size(), 2 * std::size_t{expected.inner} + 2);
        for (const std::size_t run_length : {1, 2, 3, 7, 64, 100, 1000}) {
            if (sanitized && (run_length == 2 || run_length == 64)) continue;
            SCOPED_TRACE("run_length " + std::to_string(run_length));
            const Built parts = build(keys, max_leaf, run_length);
            ASSERT_EQ(parts.nodes.size(), whole.nodes.size());
            EXPECT_EQ(parts.tree.max_depth, whole.tree.max_depth);
            EXPECT_EQ(std::memcmp(parts.nodes.data(), whole.nodes.data(),
                                  whole.nodes.size() * sizeof(BvhNode)),
                      0);
        }
        if (::testing::Test::HasFailure()) return;
    }
}

template <class Key>
void expect_right_for_many() {
    const std::uint64_t seed = 5;
    std::cout << "seed " << seed << '\n';
    Random random(seed);
    constexpr int bits = CodeFormat<Key>::bits;
    for (const std::size_t n : {2, 3, 4, 5, 16, 63, 64, 65, 66, 127, 128, 129, 500, 2000}) {
        if (test::sanitized && n > 500) continue;
        expect_right(sorted_keys<Key>(n, n, bits, random));
        expect_right(sorted_keys<Key>(n, 1, bits, random));
        expect_right(sorted_keys<Key>(n, n / 3 + 1, bits, random));
        expect_right(sorted_keys<Key>(n, n, 6, random));  // crowded: positions decide
    }
    std::vector<Key> powers;  // as deep as codes allow
    for (int bit = 0; bit < bits; ++bit) powers.push_back(Key{1} << bit);
    expect_right(powers);
}

TEST(ApetreiCpu, Codes30) { expect_right_for_many<std::uint32_t>(); }
TEST(ApetreiCpu, Codes63) { expect_right_for_many<std::uint64_t>(); }

TEST(ApetreiCpu, ThreadsDoNotMatter) {
    Random random(9);
    const auto keys = sorted_keys<std::uint64_t>(50'000, 40'000, 63, random);
    Built one;
    with_threads(1, [&] { one = build(keys, 4, 512); });
    for (const int threads : {2, 7}) {
        Built many;
        with_threads(threads, [&] { many = build(keys, 4, 512); });
        ASSERT_EQ(many.nodes.size(), one.nodes.size());
        EXPECT_EQ(
            std::memcmp(many.nodes.data(), one.nodes.data(), one.nodes.size() * sizeof(BvhNode)),
            0);
    }
}

}  // namespace
}  // namespace raydix::test
