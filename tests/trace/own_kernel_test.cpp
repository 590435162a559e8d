// Traversal kernels that are not in the library, in one file: written, checked against the scalar
// reference and counted on simulated machines. How a kernel comes into the library:
// docs/write-a-kernel.md.
#include <gtest/gtest.h>
#include <raydix/raydix.h>
#include <raydix/rays.h>
#include <raydix/simulate.h>
#include <raydix/trace.h>

#include <bit>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include "support/ray_sets.h"
#include "support/support.h"
#include "trace/warp/batch_work.h"
#include "trace/warp/per_ray.h"
#include "trace/warp/prepare_rays.h"
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

/// While-while without a stack (Laine 2010, "Restart trail for stackless BVH traversal"): a lane
/// that is done with a node begins at the root again. Its trail has a bit for each level, set where
/// nothing is left but what it goes to, and leads it to where it has not been. Trees of up to 64
/// levels. Members of Lane that other kernels need for their stacks hold the trail.
struct RestartTrail {
    static constexpr bool one_stack = false;

    template <bool any_hit, class Warp>
    static void trace(Warp& warp, const WarpScene& scene) {
        warp.step(Op::choose, [](Lane& l) { set_trail(l, 0), l.top = top_level, l.aside = none; });
        warp.loop(Op::main_loop, is_unfinished, [&] {
            warp.loop(Op::node_loop, at_inner_node, [&] {
                warp.touches(
                    Access::read, [&](const Lane& l) { return &scene.pairs[l.node]; },
                    sizeof(NodePair));
                warp.step(Op::visit_node, [&](Lane& l) { visit(l, scene.pairs[l.node]); });
                begin_again(warp);
            });
            warp.loop(Op::leaf_loop, at_leaf, [&] {
                test_triangle(warp, scene, [](const Lane& l) { return l.node; });
                warp.touches(
                    Access::read_beside, [&](const Lane& l) { return &scene.ids[~l.node]; }, 4);
                warp.step(Op::next_triangle, [&](Lane& l) {
                    const std::int32_t next = after_triangle(l.node, scene, popped_node);
                    l.node = any_hit && l.prim != no_primitive ? finished_node : next;
                });
                begin_again(warp);
            });
        });
    }

private:
    static constexpr std::uint32_t top_level = 63;  // the root's bit
    static constexpr std::int32_t none = -1;

    static std::uint64_t trail(const Lane& l) {
        return std::uint64_t{static_cast<std::uint32_t>(l.leaf)} << 32 | l.meets;
    }
    static void set_trail(Lane& l, std::uint64_t bits) {
        l.leaf = static_cast<std::int32_t>(bits >> 32), l.meets = static_cast<std::uint32_t>(bits);
    }
    /// l.top: the level. l.aside: that of the last begin, where the nearer child is done.
    static void visit(Lane& l, const NodePair& n) {
        const PairVisit met = meet_pair(l, n);
        const std::uint64_t bit = std::uint64_t{1} << l.top;
        const bool both = met.first && met.second, one = met.first != met.second;
        if (!both && (!one || static_cast<std::int32_t>(l.top) == l.aside)) {
            l.node = popped_node;
            return;
        }
        bool to_second = both ? met.second_is_closer : met.second;
        if (both && (trail(l) & bit) != 0) to_second = !to_second;
        if (one) set_trail(l, trail(l) | bit);
        l.node = to_second ? n.child1 : n.child0;
        --l.top;
    }
    template <class Warp>
    static void begin_again(Warp& warp) {
        warp.when(must_pop, [&] { warp.step(Op::pop, from_the_root); });
    }
    static void from_the_root(Lane& l) {
        const bool root = l.top == top_level;
        const std::uint64_t parent = root ? 0 : std::uint64_t{2} << l.top;
        const std::uint64_t next = root ? 0 : (trail(l) & (~parent + 1)) + parent;  // carries
        set_trail(l, next);
        l.aside = next == 0 ? none : std::countr_zero(next);
        l.top = top_level;
        l.node = next == 0 ? finished_node : 0;
    }
};

struct TestIsa;  // marks what is compiled here

struct Counted {
    std::vector<TreeHit> hits;
    double instructions_per_ray = 0;  // of warps
    double simd_efficiency = 0;
    double visits_per_ray = 0;
};

/// One batch of rays a warp. `machine`: what operations cost, those of while_while.
template <class Body, int width, bool any_hit>
Counted run_kernel(const WarpTree& tree, std::span<const Ray> rays, const MachineModel& machine) {
    Counted out{std::vector<TreeHit>(rays.size())};
    const PreparedRays prepared(rays);
    const WarpJob job{scene_of(tree),
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
TEST(OwnKernel, WithoutAStackHasThemToo) { expect_hits_at_all_widths<RestartTrail>(); }

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
        const Counted stackless = run_kernel<RestartTrail, 32, false>(tree, rays, machine);
        print("while_while", known);
        print("while_if", run_kernel<WhileIf, 32, false>(tree, rays, machine));
        print("restart_trail", stackless);
        EXPECT_GT(stackless.visits_per_ray, known.visits_per_ray);
    }
}

}  // namespace
}  // namespace raydix::test
