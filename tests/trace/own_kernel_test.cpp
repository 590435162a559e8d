// A traversal kernel that is not in the library, in one file: written, checked against the scalar
// reference and counted on a simulated machine. How a kernel comes into the library:
// docs/write-a-kernel.md.
#include <gtest/gtest.h>
#include <raydix/raydix.h>
#include <raydix/rays.h>
#include <raydix/simulate.h>
#include <raydix/trace.h>

#include <cstdio>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include "layout/warp_tree.h"
#include "support/ray_sets.h"
#include "support/support.h"
#include "trace/warp/batch_work.h"
#include "trace/warp/per_ray.h"
#include "trace/warp/prepare_rays.h"
#include "trace/warp/simulate_launch.h"
#include "trace/warp/simulated_kernels_of_width.h"

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
};

/// One batch of rays a warp. `machine`: what operations cost, those of while_while.
template <class Body, int width, bool any_hit>
Counted run_kernel(const WarpTree& tree, std::span<const Ray> rays, const MachineModel& machine) {
    Counted out{std::vector<TreeHit>(rays.size())};
    const PreparedRays prepared(rays);
    const WarpTree::Arrays& arrays = tree.arrays();
    const WarpJob job{{arrays.pairs.data(), arrays.triangles.data(), arrays.ids.data()},
                      {prepared.rays().data(), out.hits.data(),
                       static_cast<std::uint32_t>(rays.size()), nullptr}};
    const BatchWork work =
        trace_batches(SimulatedKernelOf<OneBatch<Body>, any_hit, width, TestIsa>::table, job, width,
                      tree.max_depth() + 1);
    prepared.rescale(out.hits);
    const OpCosts costs = op_costs(machine, WarpKernel::while_while);
    double issued = 0, useful = 0;
    for (std::size_t op = 0; op < op_count; ++op) {
        issued += static_cast<double>(work.counts[op].issues) * costs[op];
        useful += static_cast<double>(work.counts[op].lanes) * costs[op] / width;
    }
    out.instructions_per_ray = issued / static_cast<double>(rays.size());
    out.simd_efficiency = useful / issued;
    return out;
}

template <int width, bool any_hit>
void expect_hits_of_the_reference(const Model& scene) {
    const std::vector<Ray> rays = make_mixed_rays(scene, 4000, 7);
    const WarpTree tree(build_bvh(scene.mesh(), {.builder = Builder::ploc, .max_leaf = 4}));
    std::vector<TreeHit> expected(rays.size());
    trace_reference(tree, rays, expected, any_hit);
    const Counted found = run_kernel<WhileIf, width, any_hit>(tree, rays, machine_model("gtx285"));
    std::size_t different = 0;
    for (std::size_t i = 0; i < rays.size(); ++i)
        different += any_hit ? found.hits[i].hit() != expected[i].hit()
                             : std::memcmp(&found.hits[i], &expected[i], sizeof(TreeHit)) != 0;
    EXPECT_EQ(different, 0u) << "width " << width << (any_hit ? ", any hit" : ", closest hit");
}

TEST(OwnKernel, HasTheHitsOfTheReference) {
    for (const char* spec : {"builtin:atrium?triangles=10000", "builtin:soup?triangles=500"}) {
        const Model scene = load_model(spec);
        expect_hits_of_the_reference<1, false>(scene);
        expect_hits_of_the_reference<8, false>(scene);
        expect_hits_of_the_reference<32, false>(scene);
        expect_hits_of_the_reference<32, true>(scene);
        expect_hits_of_the_reference<64, false>(scene);
    }
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
        const Counted own = run_kernel<WhileIf, 32, false>(tree, rays, machine);
        std::printf(
            "%s: while_while %.2f warp instructions a ray, %.3f of lanes in use; "
            "while_if %.2f, %.3f\n",
            kind, known.instructions_per_ray, known.simd_efficiency, own.instructions_per_ray,
            own.simd_efficiency);
        EXPECT_GT(own.instructions_per_ray, 0.0);
    }
}

}  // namespace
}  // namespace raydix::test
