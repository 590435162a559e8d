// Counts of the launches: by hand on the talk's example, and against the tree that build_bvh makes.
#include "tree/counted_builds.h"

#include <gtest/gtest.h>
#include <raydix/error.h>

#include "keys/morton.h"
#include "support/launched_tree.h"
#include "support/support.h"
#include "tree/apetrei.h"

namespace raydix::test {
namespace {

std::vector<Aabb> boxes_for(std::size_t n) {
    std::vector<Aabb> boxes;
    for (std::size_t i = 0; i < n; ++i) {
        const auto x = static_cast<float>(i);
        boxes.push_back({{x, -x, 0}, {x + 1, 2 * x, 3}});
    }
    return boxes;
}

template <class Key>
CountedBuild count(Builder builder, Fit fit, const std::vector<Key>& keys, int max_leaf = 1,
                   StudyForm form = StudyForm::launches) {
    const std::vector<Aabb> boxes = boxes_for(keys.size());
    CountedMemory memory;
    return count_build<Key>({builder, fit, form}, keys, boxes, max_leaf, memory);
}

std::vector<std::uint64_t> items_of(const CountedBuild& build, const std::string& label) {
    std::vector<std::uint64_t> items;
    for (const LaunchRecord& launch : build.launches)
        if (launch.label == label) items.push_back(launch.items);
    return items;
}

using Items = std::vector<std::uint64_t>;
constexpr Builder family[] = {Builder::karras, Builder::lauterbach, Builder::garanzha,
                              Builder::apetrei};

TEST(CountedBuilds, ItemsOfTheTalksExample) {
    const auto keys = talk_keys<std::uint32_t>();
    const CountedBuild karras = count(Builder::karras, Fit::as_published, keys);
    EXPECT_EQ(items_of(karras, "karras.emit"), Items{7});
    EXPECT_EQ(items_of(karras, "fit.climb"), Items{7});
    EXPECT_EQ(items_of(karras, "fit.level"), Items{});

    const CountedBuild garanzha = count(Builder::garanzha, Fit::as_published, keys);
    EXPECT_EQ(items_of(garanzha, "garanzha.level"), (Items{2, 4, 6, 2}));  // children of tasks
    EXPECT_EQ(items_of(garanzha, "fit.level"), (Items{1, 3, 2, 1}));
    EXPECT_EQ(items_of(garanzha, "fit.find_level"), Items{});

    const CountedBuild apetrei = count(Builder::apetrei, Fit::as_published, keys);
    EXPECT_EQ(items_of(apetrei, "apetrei.climb"), Items{8});
    EXPECT_EQ(apetrei.launches.back().label, "apetrei.climb");  // boxes came with it

    // A pair of common prefix p has splits on 30 + 3 - p levels; the prefixes are 3 2 4 0 1 4 2.
    const CountedBuild lauterbach = count(Builder::lauterbach, Fit::as_published, keys);
    std::uint64_t splits = 0;
    for (const std::uint64_t items : items_of(lauterbach, "lauterbach.remove")) splits += items;
    EXPECT_EQ(splits, 7u * 33 - (3 + 2 + 4 + 0 + 1 + 4 + 2));
    // Five bits divide nodes; on each, all splits so far are looked at.
    EXPECT_EQ(items_of(lauterbach, "lauterbach.link"), (Items{1, 2, 4, 5, 7}));
    EXPECT_EQ(items_of(lauterbach, "fit.level"), (Items{2, 1, 2, 1, 1}));
}

TEST(CountedBuilds, EitherFitOfEveryBuilder) {
    const auto keys = talk_keys<std::uint64_t>();
    for (const Builder builder : family) {
        SCOPED_TRACE(builder_name(builder));
        const CountedBuild levels = count(builder, Fit::levels, keys);
        const bool by_bits = builder == Builder::lauterbach;
        EXPECT_EQ(items_of(levels, "fit.level"),
                  by_bits ? (Items{2, 1, 2, 1, 1}) : (Items{1, 3, 2, 1}));
        EXPECT_EQ(items_of(levels, "fit.climb"), Items{});
        const CountedBuild atomic = count(builder, Fit::atomic, keys);
        EXPECT_EQ(items_of(atomic, "fit.level"), Items{});
        EXPECT_EQ(items_of(atomic, "fit.climb"), builder == Builder::apetrei ? Items{} : Items{7});
        for (const CountedBuild* build : {&levels, &atomic}) {
            EXPECT_EQ(build->inner_count, 7u);
            EXPECT_EQ(build->max_depth, 4u);
            EXPECT_EQ(build->bounds.lo, (Vec3{0, -7, 0}));
            EXPECT_EQ(build->bounds.hi, (Vec3{8, 14, 3}));
        }
    }
}

/// A tree in which every level has one inner node: n keys, n - 1 levels.
std::vector<std::uint64_t> chain_keys(int n) {
    std::vector<std::uint64_t> keys{0};
    for (int bit = 0; bit + 1 < n; ++bit) keys.push_back(std::uint64_t{1} << bit);
    return keys;
}

TEST(CountedBuilds, AClimbIsOneChainThroughAllItsItems) {
    for (const int n : {10, 40}) {
        const std::vector<std::uint64_t> keys = chain_keys(n);
        const auto height = static_cast<std::uint32_t>(n - 1);
        const auto longest = [](const CountedBuild& build, const char* label) {
            std::uint32_t steps = 0;
            for (const LaunchRecord& launch : build.launches)
                if (launch.label == label) steps = std::max(steps, launch.longest_chain);
            return steps;
        };
        const CountedBuild karras = count(Builder::karras, Fit::atomic, keys);
        using Climb = FitBoxes<NoLeafBox>;
        EXPECT_GE(longest(karras, "fit.climb"), height * Climb::accesses_per_level);
        EXPECT_LE(longest(karras, "fit.climb"), height * Climb::accesses_per_level + 8);
        using ApetreiClimb = ClimbFromLeaf<std::uint64_t, NoLeafBox, NoProbe>;
        const CountedBuild apetrei = count(Builder::apetrei, Fit::atomic, keys);
        EXPECT_GE(longest(apetrei, "apetrei.climb"), height * ApetreiClimb::accesses_per_level);
        EXPECT_LE(longest(apetrei, "apetrei.climb"), height * ApetreiClimb::accesses_per_level + 8);
        // Level by level no launch waits long, but there are as many as levels.
        const CountedBuild garanzha = count(Builder::garanzha, Fit::levels, keys);
        EXPECT_EQ(items_of(garanzha, "fit.level").size(), height);
        EXPECT_LE(longest(garanzha, "fit.level"), 8u);
    }
}

TEST(CountedBuilds, BytesFollowTheWork) {
    std::mt19937_64 random(3);
    const auto keys = random_keys<std::uint64_t>(random, 4000, std::uint64_t{1} << 40);
    for (const Builder builder : family) {
        const CountedBuild build = count(builder, Fit::as_published, keys);
        std::uint64_t bytes = 0;
        for (const LaunchRecord& launch : build.launches) {
            bytes += launch.bytes;
            EXPECT_FALSE(launch.label.empty());
        }
        // Each key and leaf box is read at least once, each link and box written.
        EXPECT_GE(bytes, keys.size() * (8 + 24 + 2 * 32)) << builder_name(builder);
        // Split lists hold a split for nearly each of 75 levels of a key, moved and looked at.
        const std::uint64_t most = builder == Builder::lauterbach ? 75 * 80 : 2000;
        EXPECT_LE(bytes, keys.size() * most) << builder_name(builder);
        EXPECT_EQ(build.inner_count, keys.size() - 1);
    }
}

TEST(CountedBuilds, CountsDoNotDependOnThreads) {
    std::mt19937_64 random(5);
    const auto keys = random_keys<std::uint32_t>(random, 20'000, 1u << 14);
    for (const Builder builder : family) {
        CountedBuild one, many;
        with_threads(1, [&] { one = count(builder, Fit::levels, keys, 4); });
        with_threads(7, [&] { many = count(builder, Fit::levels, keys, 4); });
        ASSERT_EQ(one.launches.size(), many.launches.size());
        for (std::size_t i = 0; i < one.launches.size(); ++i) {
            EXPECT_EQ(one.launches[i].items, many.launches[i].items) << one.launches[i].label;
            EXPECT_EQ(one.launches[i].bytes, many.launches[i].bytes) << one.launches[i].label;
        }
    }
}

TEST(CountedBuilds, KernelsOfTheSourcesMakeTheSameTree) {
    std::mt19937_64 random(9);
    for (const std::uint64_t codes :
         {std::uint64_t{1}, std::uint64_t{50}, std::uint64_t{1} << 40}) {
        const auto keys = random_keys<std::uint64_t>(random, 3000, codes);
        const CountedBuild ours = count(Builder::karras, Fit::atomic, keys);
        const CountedBuild own = count(Builder::karras, Fit::atomic, keys, 1, StudyForm::published);
        EXPECT_EQ(items_of(own, "karras.link"), Items{2999});
        EXPECT_EQ(items_of(own, "fit.leaves"), Items{3000});
        EXPECT_EQ(own.launches.size(), 2u);  // no ranks, no clearing
        EXPECT_EQ(own.digest, ours.digest);
        EXPECT_EQ(own.max_depth, ours.max_depth);
        for (const int max_leaf : {1, 4}) {
            const CountedBuild by_scan = count(Builder::garanzha, Fit::levels, keys, max_leaf);
            const CountedBuild by_counter =
                count(Builder::garanzha, Fit::levels, keys, max_leaf, StudyForm::published);
            EXPECT_EQ(by_counter.digest, by_scan.digest);
            EXPECT_EQ(items_of(by_counter, "fit.level"), items_of(by_scan, "fit.level"));
            EXPECT_LT(by_counter.launches.size(), by_scan.launches.size());
            for (const Builder builder : {Builder::karras, Builder::apetrei})
                EXPECT_EQ(count(builder, Fit::atomic, keys, max_leaf, StudyForm::tuned).digest,
                          by_scan.digest);
        }
    }
    EXPECT_THROW((void)count(Builder::karras, Fit::atomic, talk_keys<std::uint32_t>(), 4,
                             StudyForm::published),
                 InputError);
    EXPECT_THROW((void)count(Builder::lauterbach, Fit::atomic, talk_keys<std::uint32_t>(), 1,
                             StudyForm::tuned),
                 InputError);
}

TEST(CountedBuilds, OneLeafAndStrangers) {
    for (const Builder builder : family)
        for (const Fit fit : {Fit::levels, Fit::atomic}) {
            const CountedBuild leaf = count(builder, fit, std::vector<std::uint32_t>{1, 2, 3}, 4);
            EXPECT_EQ(leaf.inner_count, 0u);
            EXPECT_EQ(leaf.max_depth, 0u);
            EXPECT_EQ(leaf.bounds.hi, (Vec3{3, 4, 3}));
        }
    EXPECT_THROW(
        static_cast<void>(count(Builder::ploc, Fit::levels, std::vector<std::uint32_t>{1, 2, 3})),
        InputError);
}

}  // namespace
}  // namespace raydix::test
