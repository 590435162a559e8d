// Traversal kernels that are not in the library, in one file: written, checked against the scalar
// reference and counted on simulated machines. How a kernel comes into the library:
// docs/write-a-kernel.md.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/raydix.h>
#include <raydix/rays.h>
#include <raydix/simulate.h>
#include <raydix/trace.h>

#include <cstdint>
#include <cstdio>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include "support/ray_sets.h"
#include "support/scenes.h"
#include "support/support.h"
#include "trace/warp/batch_work.h"
#include "trace/warp/per_ray.h"
#include "trace/warp/prepare_rays.h"
#include "trace/warp/restart_trail.h"
#include "trace/warp/simulate_launch.h"
#include "trace/warp/simulated_kernels_of_width.h"
#include "trace/warp/warp_scene.h"

namespace raydix::test {
namespace {

/// Nodes until each lane has come to a leaf, then one triangle: lanes whose leaf has more of them
/// keep it while the others walk on.
struct WhileIf {
    static constexpr bool one_stack = false;

    template <bool any_hit, class Warp>
    static void trace(Warp& warp, const WarpScene& scene) {
        warp.loop(Op::main_loop, is_unfinished, [&] {
            warp.loop(Op::node_loop, at_inner_node, [&] { visit_once(warp, scene); });
            warp.when(at_leaf, [&] { test_in_place<any_hit>(warp, scene); });
        });
    }
};

struct TestIsa;  // marks what is compiled here

struct Counted {
    std::vector<TreeHit> hits;
    double instructions_per_ray = 0;  // of warps
    double simd_efficiency = 0;
    double visits_per_ray = 0;
};

/// One batch of rays a warp. `machine`: what operations cost, those of `like`.
template <class Body, int width, bool any_hit>
Counted run_kernel(const WarpTree& tree, std::span<const Ray> rays, const MachineModel& machine,
                   WarpKernel like = WarpKernel::while_while) {
    Counted out{std::vector<TreeHit>(rays.size())};
    const PreparedRays prepared(rays);
    const WarpJob job{scene_of(tree),
                      {prepared.rays().data(), out.hits.data(),
                       static_cast<std::uint32_t>(rays.size()), nullptr}};
    const BatchWork work =
        trace_batches(SimulatedKernelOf<OneBatch<Body>, any_hit, width, TestIsa>::table, job, width,
                      tree.max_depth() + 1);
    prepared.rescale(out.hits);
    const OpCosts costs = op_costs(machine, like);
    double issued = 0, useful = 0;
    for (std::size_t op = 0; op < op_count; ++op) {
        issued += static_cast<double>(work.counts[op].issues) * costs[op];
        useful += static_cast<double>(work.counts[op].lanes) * costs[op] / width;
    }
    out.instructions_per_ray = issued / static_cast<double>(rays.size());
    out.simd_efficiency = useful / issued;
    out.visits_per_ray =
        static_cast<double>(work.counts[static_cast<std::size_t>(Op::visit_node)].lanes) /
        static_cast<double>(rays.size());
    return out;
}

template <class Body, int width, bool any_hit>
void expect_hits_of_the_reference(const Model& scene) {
    const std::vector<Ray> rays = make_mixed_rays(scene, 4000, 7);
    const WarpTree tree(build_bvh(scene.mesh(), {.builder = Builder::ploc, .max_leaf = 4}));
    std::vector<TreeHit> expected(rays.size());
    trace_reference(tree, rays, expected, any_hit);
    const Counted found = run_kernel<Body, width, any_hit>(tree, rays, machine_model("gtx285"));
    std::size_t different = 0;
    for (std::size_t i = 0; i < rays.size(); ++i)
        different += any_hit ? found.hits[i].hit() != expected[i].hit()
                             : std::memcmp(&found.hits[i], &expected[i], sizeof(TreeHit)) != 0;
    EXPECT_EQ(different, 0u) << "width " << width << (any_hit ? ", any hit" : ", closest hit");
}

template <class Body>
void expect_hits_at_all_widths() {
    for (const char* spec : {"builtin:atrium?triangles=10000", "builtin:soup?triangles=500"}) {
        SCOPED_TRACE(spec);
        const Model scene = load_model(spec);
        expect_hits_of_the_reference<Body, 1, false>(scene);
        expect_hits_of_the_reference<Body, 8, false>(scene);
        expect_hits_of_the_reference<Body, 32, false>(scene);
        expect_hits_of_the_reference<Body, 32, true>(scene);
        expect_hits_of_the_reference<Body, 64, false>(scene);
    }
}

TEST(OwnKernel, HasTheHitsOfTheReference) { expect_hits_at_all_widths<WhileIf>(); }
TEST(OwnKernel, OfNoStackAndOfTwoEntriesHaveThemToo) {
    expect_hits_at_all_widths<RestartTrail<0>>();
    expect_hits_at_all_widths<RestartTrail<2>>();
}

TEST(OwnKernel, IsCountedAsThoseOfTheLibraryAre) {
    const Model scene = load_model("builtin:atrium?triangles=20000");
    const Bvh bvh = build_bvh(scene.mesh(), {.builder = Builder::split, .max_leaf = 8});
    const WarpTree tree(bvh);
    std::vector<std::uint32_t> pixels;
    const std::vector<Ray> primary =
        make_primary_rays(scene.cameras.cameras.front(), 128, 96, &pixels);
    const std::vector<Ray> diffuse = make_secondary_rays(bvh, primary, trace(bvh, primary), pixels,
                                                         {.kind = RayKind::diffuse, .samples = 2});
    const MachineModel machine = machine_model("gtx285");
    for (const auto& [kind, rays] :
         {std::pair{"primary", primary}, std::pair{"diffuse", diffuse}}) {
        const Counted known = run_kernel<WhileWhile, 32, false>(tree, rays, machine);
        const SimulateOptions options{.kernel = WarpKernel::while_while, .machine = machine};
        const Simulation library = simulate(tree, rays, std::span(&options, 1)).front();
        EXPECT_DOUBLE_EQ(known.instructions_per_ray, static_cast<double>(library.instructions) /
                                                         static_cast<double>(library.rays));
        const auto print = [of = kind](const char* name, const Counted& kernel) {
            std::printf(
                "%s, %s: %.1f warp instructions a ray, %.2f of lanes in use, %.1f visits a ray\n",
                name, of, kernel.instructions_per_ray, kernel.simd_efficiency,
                kernel.visits_per_ray);
            EXPECT_GT(kernel.instructions_per_ray, 0.0);
        };
        print("while_while", known);
        print("while_if", run_kernel<WhileIf, 32, false>(tree, rays, machine));
    }
}

TEST(ShortStack, HasATrailForSixtyFourLevelsAndRefusesMore) {
    const SimulateOptions run{.kernel = WarpKernel::short_stack, .machine = machine_model("h200")};
    bool reached = false, refused = false;
    for (int count = 2; count < 140 && !refused; ++count) {
        const Model scene = scene_of(nested_triangles(count), "chain");
        const WarpTree tree(build_bvh(scene.mesh(), {.builder = Builder::ploc, .max_leaf = 1}));
        const std::vector<Ray> rays = make_mixed_rays(scene, 300, 3);
        if (tree.max_depth() >= trail_levels) {
            EXPECT_THROW(static_cast<void>(simulate(tree, rays, std::span(&run, 1))), InputError);
            refused = true;
            continue;
        }
        if (tree.max_depth() + 1 < trail_levels) continue;
        reached = true;
        std::vector<TreeHit> expected(rays.size());
        trace_reference(tree, rays, expected);
        std::vector<std::vector<TreeHit>> hits;
        static_cast<void>(simulate(tree, rays, std::span(&run, 1), &hits));
        EXPECT_EQ(std::memcmp(hits[0].data(), expected.data(), expected.size() * sizeof(TreeHit)),
                  0)
            << count << " triangles";
        const Counted bare =
            run_kernel<RestartTrail<0>, 32, false>(tree, rays, machine_model("h200"));
        EXPECT_EQ(std::memcmp(bare.hits.data(), expected.data(), expected.size() * sizeof(TreeHit)),
                  0);
    }
    EXPECT_TRUE(reached && refused);
}

/// The more entries, the fewer nodes are visited again; with eight hardly any.
TEST(ShortStack, VisitsByEntries) {
    const Model scene = load_model("builtin:atrium?triangles=20000");
    const WarpTree tree(build_bvh(scene.mesh(), {.builder = Builder::split, .max_leaf = 8}));
    const MachineModel machine = machine_model("h200");
    const std::vector<Ray> rays = make_primary_rays(scene.cameras.cameras.front(), 128, 96);
    const double least = run_kernel<WhileWhile, 32, false>(tree, rays, machine).visits_per_ray;
    double before = 1e9;
    const auto compare = [&]<int entries>(std::integral_constant<int, entries>) {
        const Counted found = run_kernel<RestartTrail<entries>, 32, false>(tree, rays, machine,
                                                                           WarpKernel::short_stack);
        std::printf("%d entries: %.1f visits a ray, of while_while's %.2f\n", entries,
                    found.visits_per_ray, found.visits_per_ray / least);
        EXPECT_LT(found.visits_per_ray, before);
        before = found.visits_per_ray;
    };
    compare(std::integral_constant<int, 0>());
    compare(std::integral_constant<int, 2>());
    compare(std::integral_constant<int, 4>());
    EXPECT_LT(before, 1.03 * least);
    compare(std::integral_constant<int, 8>());
    EXPECT_GE(before, least);
    EXPECT_LT(before, 1.01 * least);
}

/// Its pops read registers: what a stack in memory takes is nothing to it, and starts of rays are
/// charged once.
TEST(ShortStack, IsChargedForNoStackInMemory) {
    const Model scene = load_model("builtin:atrium?triangles=10000");
    const WarpTree tree(build_bvh(scene.mesh()));
    const std::vector<Ray> rays = make_mixed_rays(scene, 3200, 3);
    std::vector<SimulateOptions> runs;
    for (const WarpKernel kernel : {WarpKernel::while_while, WarpKernel::short_stack})
        for (const std::uint32_t clocks : {0u, 5000u}) {
            runs.push_back({.kernel = kernel, .machine = machine_model("gtx285")});
            runs.back().machine.stack_read_clocks = clocks;
        }
    const std::vector<Simulation> figures = simulate(tree, rays, runs);
    EXPECT_LT(figures[0].scheduled_clocks, figures[1].scheduled_clocks);
    EXPECT_EQ(figures[2].scheduled_clocks, figures[3].scheduled_clocks);
    const auto starts = [&](std::size_t k) {
        return figures[k].operations[static_cast<std::size_t>(Op::start_ray)].issues;
    };
    EXPECT_EQ(starts(2), starts(0));
}

}  // namespace
}  // namespace raydix::test
