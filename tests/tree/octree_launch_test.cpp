// The octree's pipeline as launches: counted ones give the same nodes, too little room gives none
// at all, and the radix tree's numbers are those of the paper.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <set>

#include "support/support.h"
#include "tree/octree.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t octree_launch_seed = 31;

template <class Key>
std::vector<Key> sorted_codes(std::size_t n, Key mask) {
    std::mt19937_64 random(octree_launch_seed);
    std::vector<Key> codes(n);
    for (Key& code : codes) code = static_cast<Key>(random()) & mask;
    std::ranges::sort(codes);
    return codes;
}

/// What one run of the pipeline leaves behind.
struct PipelineRun {
    std::uint32_t count = 0;
    std::vector<OctreeNode> nodes;
    std::vector<std::uint32_t> level_begin;
    std::vector<LaunchRecord> log;
};

/// `room`: nodes there is memory for; -1: as many as there are.
template <class Probe, class Key>
PipelineRun run(const std::vector<Key>& codes, OctreeRule rule, std::int64_t room = -1) {
    PipelineRun result;
    const auto n = static_cast<std::uint32_t>(codes.size());
    HostLauncher<Probe> launcher(&result.log);
    Arena size;
    (void)take_radix_chains<Key, Probe>(size, n, rule);
    std::vector<std::byte> memory(size.bytes(), std::byte{0xCD});
    Arena arena(memory.data(), memory.size());
    const auto radix = take_radix_chains<Key, Probe>(arena, n, rule);
    count_octree(launcher, codes.data(), &n, n, radix);
    result.count = *radix.node_count;
    const std::uint32_t capacity = room < 0 ? result.count : static_cast<std::uint32_t>(room);
    Arena order_size;
    (void)take_chain_order(order_size, capacity);
    std::vector<std::byte> order_memory(order_size.bytes(), std::byte{0xCD});
    Arena order_arena(order_memory.data(), order_memory.size());
    const ChainOrder order = take_chain_order(order_arena, capacity);
    OctreeNode untouched;
    std::memset(&untouched, 0xAB, sizeof untouched);
    result.nodes.assign(capacity, untouched);
    result.level_begin.assign(static_cast<std::size_t>(rule.max_level) + 2, 0xABABABAB);
    emit_octree(launcher, n, radix, order, result.nodes.data(), result.level_begin.data());
    return result;
}

bool same(const std::vector<OctreeNode>& a, const std::vector<OctreeNode>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]) == 0;
}

TEST(OctreeLaunch, CountingChangesNothingAndCountsEveryLaunch) {
    const auto codes = sorted_codes<std::uint64_t>(5000, 0x7FFFFFFFFFFFFFFFull);
    const OctreeRule rule{21, 3};
    const PipelineRun plain = run<NoProbe>(codes, rule), counted = run<CountProbe>(codes, rule);
    EXPECT_TRUE(same(plain.nodes, counted.nodes));
    EXPECT_EQ(plain.level_begin, counted.level_begin);
    std::set<std::string> labels;
    for (const LaunchRecord& record : counted.log) {
        labels.insert(record.label);
        EXPECT_GT(record.items, 0u) << record.label;
        EXPECT_GT(record.bytes, 0u) << record.label;
    }
    EXPECT_EQ(labels.size(),
              15u);  // 10 of functors; the sort's 3 and its copy, two scans by one row
    // Ranges are found by dependent look-ups; twice the logarithm of the galloping distance and
    // more.
    const auto radix = std::ranges::find(counted.log, "octree.radix", &LaunchRecord::label);
    ASSERT_NE(radix, counted.log.end());
    EXPECT_GT(radix->longest_chain, 12u);
}

TEST(OctreeLaunch, TooLittleRoomWritesNothing) {
    const auto codes = sorted_codes<std::uint32_t>(500, 0x3FFFFFFFu);
    const OctreeRule rule{10, 1};
    const PipelineRun whole = run<NoProbe>(codes, rule);
    ASSERT_GT(whole.count, 600u);
    for (const std::int64_t room :
         {std::int64_t{0}, std::int64_t{1}, std::int64_t{whole.count} - 1}) {
        const PipelineRun cut = run<NoProbe>(codes, rule, room);
        EXPECT_EQ(cut.count, whole.count);
        for (const OctreeNode& node : cut.nodes) EXPECT_EQ(node.level, 0xABABABABu);
        for (const std::uint32_t begin : cut.level_begin) EXPECT_EQ(begin, 0xABABABABu);
    }
    const PipelineRun more = run<NoProbe>(codes, rule, std::int64_t{whole.count} + 10);
    EXPECT_TRUE(std::equal(whole.nodes.begin(), whole.nodes.end(), more.nodes.begin(),
                           [](const OctreeNode& a, const OctreeNode& b) {
                               return std::memcmp(&a, &b, sizeof a) == 0;
                           }));
    EXPECT_EQ(more.nodes.back().level, 0xABABABABu);
    EXPECT_EQ(more.level_begin, whole.level_begin);
}

/// Two codes of 30 bits in 32 that differ in their first bit: only the root above them. If the two
/// unused bits counted, the common prefix would be two bits longer.
TEST(OctreeLaunch, UnusedBitsOfACodeDoNotCount) {
    const std::vector<std::uint32_t> codes{0x00000000u, 0x20000000u};
    const PipelineRun small = run<NoProbe>(codes, {10, 1});
    ASSERT_EQ(small.count, 3u);
    EXPECT_EQ(small.nodes[0].child_mask, 0b00010001u);
    EXPECT_EQ(small.level_begin[1], 1u);
    EXPECT_EQ(small.level_begin[2], 3u);
    const std::vector<std::uint64_t> wide{0, std::uint64_t{1} << 62};
    EXPECT_EQ(run<NoProbe>(wide, {21, 1}).count, 3u);
}

/// The sum of floor(delta / 3) - floor(delta(parent) / 3) over a chain of radix nodes is the number
/// of levels between them: each prefix of the codes, cut to whole triples, is one node.
TEST(OctreeLaunch, NodesAreTheDistinctPrefixes) {
    for (const std::uint64_t mask :
         {0x7FFFFFFFFFFFFFFFull, 0x0000000FFFull, 0x7000000000000007ull}) {
        const auto codes = sorted_codes<std::uint64_t>(700, mask);
        for (const int max_level : {0, 1, 5, 20, 21}) {
            std::set<std::pair<int, std::uint64_t>> prefixes;
            for (const std::uint64_t code : codes)
                for (int level = 0; level <= max_level; ++level)
                    prefixes.insert({level, code >> (3 * (21 - level))});
            // Without a leaf size, every code is divided down to max_level.
            const PipelineRun built = run<NoProbe>(codes, {max_level, 0});
            ASSERT_EQ(built.count, prefixes.size());
            std::size_t i = 0;
            for (const auto& [level, prefix] : prefixes) {
                EXPECT_EQ(static_cast<int>(built.nodes[i].level), level);
                EXPECT_EQ(built.nodes[i].code, prefix);
                ++i;
            }
        }
    }
}

}  // namespace
}  // namespace raydix::test
