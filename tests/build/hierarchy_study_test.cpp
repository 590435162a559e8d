// The counted launches and the model that turns them into times.
#include <gtest/gtest.h>
#include <raydix/bvh.h>
#include <raydix/error.h>
#include <raydix/hierarchy_study.h>

#include <cmath>
#include <numeric>

#include "support/sanitized.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr Builder lbvh_builders[] = {Builder::karras, Builder::lauterbach, Builder::garanzha,
                                     Builder::apetrei};

HierarchyRun study(const Mesh& mesh, Builder builder, Fit fit, int bits = 63) {
    return study_hierarchy(mesh, {.builder = builder, .bits = bits, .max_leaf = 1, .fit = fit}, 1);
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
    run.launches.push_back({"one", items, bytes, steps, chain, 0});
    return run;
}

TEST(HierarchyStudy, EveryBuilderMakesTheTreeOfTheLibrary) {
    const Mesh mesh = random_soup(3000, 4);
    const Bvh tree = build_bvh(mesh, {.max_leaf = 1});
    for (const Builder builder : lbvh_builders) {
        for (const Fit fit : {Fit::levels, Fit::atomic}) {
            const HierarchyRun run = study(mesh, builder, fit);
            EXPECT_EQ(run.keys, 3000u);
            EXPECT_EQ(run.inner_nodes, tree.inner_count());
            EXPECT_EQ(run.max_depth, tree.max_depth());
            EXPECT_TRUE(run.refusal.empty());
            EXPECT_GT(run.measured_ms(), 0);
            std::uint64_t bytes = 0;
            for (const LaunchFigures& launch : run.launches) bytes += launch.bytes;
            // Each pair of nodes and each box must be written at least.
            EXPECT_GT(bytes, 64u * run.inner_nodes) << builder_name(builder);
            if (fit == Fit::levels) {
                EXPECT_EQ(std::accumulate(run.items_per_level.begin(), run.items_per_level.end(),
                                          std::uint64_t{0}),
                          run.inner_nodes);
                EXPECT_EQ(run.items_per_level.front(), 1u);
            }
        }
    }
}

TEST(HierarchyStudy, LevelByLevelTakesALaunchALevel) {
    const Mesh mesh = random_soup(5000, 8);
    const HierarchyRun karras = study(mesh, Builder::karras, Fit::atomic);
    const HierarchyRun garanzha = study(mesh, Builder::garanzha, Fit::levels);
    EXPECT_LT(karras.launches.size(), 8u);
    EXPECT_GT(garanzha.launches.size(), 2u * garanzha.max_depth);
    // So much larger a machine helps the one, not the other.
    const LaunchMachine machine = study_machines().front();
    const auto speed_up = [&](const HierarchyRun& run) {
        return predicted_ms(run, machine, 1) / predicted_ms(run, machine, 64);
    };
    const HierarchyRun large =
                           study(random_soup(fewer(200'000, 4), 8), Builder::karras, Fit::atomic),
                       large_levels =
                           study(random_soup(fewer(200'000, 4), 8), Builder::garanzha, Fit::levels);
    EXPECT_GT(speed_up(large), speed_up(large_levels));
}

TEST(HierarchyStudy, CountsDoNotDependOnThreads) {
    const Mesh mesh = random_soup(fewer(20'000, 4), 3);
    for (const Builder builder : lbvh_builders) {
        BuildOptions options{.builder = builder, .max_leaf = 1, .fit = Fit::levels, .threads = 1};
        const HierarchyRun one = study_hierarchy(mesh, options, 1);
        options.threads = 3;
        const HierarchyRun three = study_hierarchy(mesh, options, 1);
        ASSERT_EQ(one.launches.size(), three.launches.size());
        for (std::size_t k = 0; k < one.launches.size(); ++k) {
            EXPECT_EQ(one.launches[k].items, three.launches[k].items);
            EXPECT_EQ(one.launches[k].bytes, three.launches[k].bytes);
            EXPECT_EQ(one.launches[k].steps, three.launches[k].steps);
            EXPECT_EQ(one.launches[k].longest_chain, three.launches[k].longest_chain);
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

TEST(HierarchyStudy, FewAndNoPrimitives) {
    for (const Builder builder : lbvh_builders) {
        EXPECT_EQ(study(Mesh{}, builder, Fit::atomic).keys, 0u);
        for (const std::size_t n : {1, 2, 3})
            EXPECT_EQ(study(random_soup(n, 1), builder, Fit::levels).inner_nodes, n - 1);
    }
    EXPECT_THROW(study(random_soup(5, 1), Builder::ploc, Fit::atomic), InputError);
    EXPECT_THROW((void)study_hierarchy(random_soup(5, 1), {.reinsertion_rounds = 1}, 1),
                 InputError);
    Mesh bad = random_soup(5, 1);
    bad.triangles[3] = {0, 1, 99};
    EXPECT_THROW(study(bad, Builder::lauterbach, Fit::atomic), InputError);
}

TEST(HierarchyStudy, ThisMachineHasFiguresThatCanBe) {
    const LaunchMachine machine = measure_this_machine(1);
    EXPECT_EQ(machine.lanes, 1);
    for (const double figure :
         {machine.item_ns, machine.step_ns, machine.bytes_per_ns, machine.latency_ns})
        EXPECT_TRUE(std::isfinite(figure) && figure > 0) << figure;
    EXPECT_GE(machine.launch_us, 0);
}

}  // namespace
}  // namespace raydix::test
