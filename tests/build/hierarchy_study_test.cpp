// The counted launches, and the models that turn them into times.
#include <gtest/gtest.h>
#include <raydix/bvh.h>
#include <raydix/error.h>
#include <raydix/hierarchy_study.h>
#include <raydix/kdtree.h>
#include <raydix/octree.h>

#include <cmath>
#include <numeric>
#include <set>

#include "support/message.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix::test {
namespace {

const StudyCase own{"karras", StudyForm::published, Fit::atomic};
const StudyCase queue{"garanzha", StudyForm::published, Fit::levels};

std::vector<HierarchyRun> study_all(const Mesh& mesh, int bits = 63, int threads = 0) {
    return study_hierarchy(mesh, {.bits = bits, .threads = threads, .repeat = 1});
}
HierarchyRun study(const Mesh& mesh, const StudyCase& what, int bits = 63) {
    return study_hierarchy(mesh, {.bits = bits, .threads = 0, .repeat = 1, .cases = {what}})
        .front();
}

LaunchMachine toy() {
    return {.name = "toy",
            .lanes = 4,
            .item_ns = 1,
            .step_ns = 2,
            .bytes_per_ns = 8,
            .latency_ns = 10,
            .launch_us = 1,
            .origin = "a test"};
}

HierarchyRun one_launch(std::uint64_t items, std::uint64_t bytes, std::uint64_t steps,
                        std::uint32_t chain) {
    HierarchyRun run;
    run.what = own;
    run.keys = 1000;
    run.launches.push_back({"one", items, bytes, steps, chain, 0});
    return run;
}

TEST(HierarchyStudy, EveryBuilderMakesTheTreeOfTheLibrary) {
    const Mesh mesh = random_soup(3000, 4);
    const Bvh tree = build_bvh(mesh, {.max_leaf = 1});
    std::set<std::string> digests;
    std::set<std::vector<std::uint64_t>> levels;
    std::size_t builders = 0;
    for (const HierarchyRun& run : study_all(mesh)) {
        SCOPED_TRACE(run.what.name());
        EXPECT_EQ(run.keys, 3000u);
        EXPECT_TRUE(run.refusal.empty());
        EXPECT_GT(run.measured_ms(), 0);
        if (!run.what.is_builder()) continue;
        ++builders;
        EXPECT_EQ(run.inner_nodes, tree.inner_count());
        EXPECT_EQ(run.max_depth, tree.max_depth());
        digests.insert(run.digest);
        if (run.what.form == StudyForm::tuned) continue;
        std::uint64_t bytes = 0;
        for (const LaunchFigures& launch : run.launches) bytes += launch.bytes;
        EXPECT_GT(bytes, 64u * run.inner_nodes);  // each pair of nodes and each box is written
        if (run.what.fit != Fit::levels) continue;
        EXPECT_EQ(std::accumulate(run.items_per_level.begin(), run.items_per_level.end(),
                                  std::uint64_t{0}),
                  run.inner_nodes);
        EXPECT_EQ(run.items_per_level.front(), 1u);
        EXPECT_EQ(run.items_per_level.size(), run.max_depth);
        levels.insert(run.items_per_level);
    }
    EXPECT_EQ(levels.size(), 1u);
    EXPECT_EQ(builders, 13u);
    EXPECT_EQ(digests.size(), 1u);
    EXPECT_NE(study(random_soup(3000, 5), own).digest, *digests.begin());
}

TEST(HierarchyStudy, OtherTreesAreThoseOfTheLibrary) {
    const Mesh mesh = random_soup(2000, 4);
    EXPECT_EQ(study(mesh, {"kdtree"}).inner_nodes,
              build_kdtree(mesh, {.bits = 63, .max_leaf = 1}).inner_count());
    EXPECT_EQ(study(mesh, {"octree"}, 30).inner_nodes,
              build_octree(mesh, {.bits = 30, .max_level = 10, .max_leaf = 1}).nodes().size());
}

/// Every pass of the sort is there, and moves each pair once.
TEST(HierarchyStudy, SortsAndScansAreCountedPassByPass) {
    const HierarchyRun run = study(random_soup(20'000, 6), {"sort"}, 30);
    std::uint64_t moves = 0, counts = 0, scans = 0;
    for (const LaunchFigures& launch : run.launches) {
        if (launch.label == "sort.move") {
            ++moves;
            EXPECT_EQ(launch.items, 20'000u);
            EXPECT_EQ(launch.bytes, 20'000u * 2 * 8);
            EXPECT_EQ(launch.longest_chain, 2u);
        } else if (launch.label == "sort.count") {
            ++counts;
            EXPECT_EQ(launch.bytes, 20'000u * 4 + 2 * 256 * 4);  // two blocks
        } else if (launch.label == "sort.copy") {                // after an even number of passes
            EXPECT_EQ(launch.bytes, 20'000u * 2 * 8);
        } else {
            ++scans;
            EXPECT_EQ(launch.label, "sort.starts.row");
            EXPECT_EQ(launch.items, 512u);
            EXPECT_EQ(launch.bytes, 512u * 8);
        }
    }
    EXPECT_EQ(moves, 4u);
    EXPECT_EQ(counts, 4u);
    EXPECT_EQ(scans, 4u);
}

TEST(HierarchyStudy, LevelByLevelTakesALaunchALevel) {
    const Mesh mesh = random_soup(fewer(200'000, 4), 8);
    const HierarchyRun karras = study(mesh, own), garanzha = study(mesh, queue);
    EXPECT_EQ(karras.launches.size(), 2u);
    EXPECT_GE(garanzha.launches.size(), 2u * garanzha.max_depth);
    // So much larger a machine helps the one, not the other.
    const LaunchMachine machine = study_machines().front();
    const auto speed_up = [&](const HierarchyRun& run) {
        return predicted_ms(run, machine, 1) / predicted_ms(run, machine, 64);
    };
    EXPECT_GT(speed_up(karras), speed_up(garanzha));
}

TEST(HierarchyStudy, CountsDoNotDependOnThreads) {
    const Mesh mesh = random_soup(fewer(20'000, 4), 3);
    const std::vector<HierarchyRun> one = study_all(mesh, 63, 1), three = study_all(mesh, 63, 3);
    ASSERT_EQ(one.size(), three.size());
    for (std::size_t r = 0; r < one.size(); ++r) {
        SCOPED_TRACE(one[r].what.name());
        ASSERT_EQ(one[r].launches.size(), three[r].launches.size());
        for (std::size_t k = 0; k < one[r].launches.size(); ++k) {
            const LaunchFigures &a = one[r].launches[k], &b = three[r].launches[k];
            EXPECT_EQ(a.items, b.items) << a.label;
            EXPECT_EQ(a.bytes, b.bytes) << a.label;
            EXPECT_EQ(a.longest_chain, b.longest_chain) << a.label;
            // Which of two items climbs on is chance: of those, the sum is kept.
            EXPECT_EQ(a.steps, b.steps) << a.label;
        }
    }
}

TEST(HierarchyStudy, TheModelTakesTheLongestOfThree) {
    const LaunchMachine machine = toy();
    EXPECT_DOUBLE_EQ(predicted_ms(one_launch(0, 0, 0, 0), machine), 1e-3);  // the launch alone
    EXPECT_DOUBLE_EQ(predicted_ms(one_launch(4000, 0, 2000, 0), machine), 1e-3 + 2000e-6);
    EXPECT_DOUBLE_EQ(predicted_ms(one_launch(4000, 80'000, 2000, 0), machine), 1e-3 + 10'000e-6);
    EXPECT_DOUBLE_EQ(predicted_ms(one_launch(4000, 80'000, 2000, 2000), machine), 1e-3 + 20'000e-6);
    // Twice the machine halves work and bytes, and nothing else.
    EXPECT_DOUBLE_EQ(predicted_ms(one_launch(4000, 0, 2000, 0), machine, 2), 1e-3 + 1000e-6);
    EXPECT_DOUBLE_EQ(predicted_ms(one_launch(0, 80'000, 0, 0), machine, 2), 1e-3 + 5000e-6);
    EXPECT_DOUBLE_EQ(predicted_ms(one_launch(0, 0, 0, 2000), machine, 2), 1e-3 + 20'000e-6);
}

TEST(HierarchyStudy, AKernelsCostIsThatOfItsSize) {
    const KernelCost cost{"k", {{100, 2}, {10'000, 6}}};
    EXPECT_DOUBLE_EQ(cost.at(1), 2);
    EXPECT_DOUBLE_EQ(cost.at(100), 2);
    EXPECT_DOUBLE_EQ(cost.at(1000), 4);  // half of the way, in orders of magnitude
    EXPECT_DOUBLE_EQ(cost.at(1e6), 6);
}

TEST(HierarchyStudy, WorkHereIsSharedByItems) {
    MeasuredCosts costs{.launch_us = 1, .latency_ns = 10, .kernels = {}, .origin = "a test"};
    costs.kernels.push_back({own.name() + ": one", {{1000, 3}}});
    const auto ms = [&](const HierarchyRun& run, double factor) {
        return predicted_ms(run, costs, factor);
    };
    const HierarchyRun wide = one_launch(4000, 0, 2000, 0), narrow = one_launch(4, 0, 5996, 0);
    EXPECT_DOUBLE_EQ(ms(wide, 1), 1e-3 + 18'000e-6);
    EXPECT_DOUBLE_EQ(ms(wide, 8), 1e-3 + 18'000e-6 / 8);
    EXPECT_DOUBLE_EQ(ms(wide, 0.5), 1e-3 + 18'000e-6 * 2);
    EXPECT_DOUBLE_EQ(ms(narrow, 8), 1e-3 + 18'000e-6 / 4);  // four items fill four threads
    const HierarchyRun chain = one_launch(4000, 0, 2000, 1000);
    EXPECT_DOUBLE_EQ(ms(chain, 1), 1e-3 + 18'000e-6);
    EXPECT_DOUBLE_EQ(ms(chain, 64), 1e-3 + 10'000e-6);
    EXPECT_DOUBLE_EQ(ms(one_launch(1, 0, 0, 1000), 1), 1e-3 + 3e-6);  // never more than its work
    HierarchyRun tuned = wide;
    tuned.what = {"karras", StudyForm::tuned, Fit::atomic};
    EXPECT_TRUE(std::isnan(ms(tuned, 2)));
    HierarchyRun unknown = wide;
    unknown.launches.front().label = "another";
    EXPECT_TRUE(std::isnan(ms(unknown, 1)));
}

TEST(HierarchyStudy, FewAndNoPrimitives) {
    for (const HierarchyRun& run : study_all(Mesh{})) EXPECT_EQ(run.keys, 0u);
    for (const std::size_t n : {1, 2, 3})
        for (const HierarchyRun& run : study_all(random_soup(n, 1))) {
            if (!run.what.is_builder()) continue;
            EXPECT_EQ(run.inner_nodes, n - 1) << run.what.name();
        }
    EXPECT_THROW(study(random_soup(5, 1), {"ploc"}), InputError);
    try {  // the study has it with boxes in one pass and by levels
        static_cast<void>(study(random_soup(5, 1), {"karras"}));
        FAIL();
    } catch (const InputError& error) {
        EXPECT_STREQ(error.what(), "the study has no case karras, boxes as published");
    }
    EXPECT_THROW((void)study_hierarchy(random_soup(5, 1), {.repeat = 0}), InputError);
    EXPECT_THROW((void)study_hierarchy(random_soup(5, 1), {.bits = 31}), InputError);
    EXPECT_THROW((void)study_hierarchy(random_soup(5, 1), {.max_leaf = 0}), InputError);
    Mesh bad = random_soup(5, 1);
    bad.triangles[3] = {0, 1, 99};
    EXPECT_THROW(study(bad, queue), InputError);
    const Mesh good = random_soup(5, 1);
    const MeshView both[] = {MeshView(good), MeshView(bad)};
    EXPECT_EQ(message_of([&] { (void)study_hierarchies(both, {.repeat = 1}); }),
              "mesh 1: triangle 3: an index is past the last vertex");
    // The kernels of the paper know leaves of one primitive only.
    const auto larger = study_hierarchy(random_soup(50, 1), {.max_leaf = 4, .cases = {own, queue}});
    EXPECT_NE(larger[0].refusal, "");
    EXPECT_EQ(larger[1].refusal, "");
}

TEST(HierarchyStudy, ThisMachineHasFiguresThatCanBe) {
    const Mesh small = cost_sheet(500, 1), large = cost_sheet(4000, 1);
    EXPECT_NEAR(static_cast<double>(large.triangles.size()), 4000, 200);
    const MeshView sheets[] = {MeshView(small), MeshView(large)};
    const MeasuredCosts costs = costs_of(study_hierarchies(sheets, {.threads = 1, .repeat = 1}));
    EXPECT_GT(costs.latency_ns, 0);
    EXPECT_GT(costs.launch_us, 0);
    const HierarchyRun run = study(random_soup(1000, 2), own, 30);
    for (const LaunchFigures& launch : run.launches) {
        const KernelCost* cost = costs.find(own.name() + ": " + launch.label);
        ASSERT_NE(cost, nullptr) << launch.label;
        EXPECT_EQ(cost->points.size(), 2u);
        EXPECT_GT(cost->at(1000), 0);
    }
    EXPECT_GT(predicted_ms(run, costs), 0);
}

}  // namespace
}  // namespace raydix::test
