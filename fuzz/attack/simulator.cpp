// Kernels of the warp simulator: the same hits from every kernel and warp width as from the scalar
// reference of the same test; pictures, the same for every thread count.
#include <raydix/picture.h>
#include <raydix/simulate.h>

#include <algorithm>

#include "attack/attack.h"
#include "attack/vectors.h"

namespace raydix::attack {
namespace {

/// Rays that begin within some scene sizes, of directions near unit length: what the boxes of these
/// kernels are widened for.
std::vector<Ray> ordinary_rays(Random& random, const Mesh& mesh) {
    const Aabb box = finite_bounds(mesh);
    const Vec3 size = box.hi - box.lo, center = box.lo + size * 0.5f;
    const float longest = std::max({size.x, size.y, size.z});
    std::vector<Ray> rays(100);
    for (Ray& ray : rays) {
        ray.origin = center + random.cube() * longest;
        const Vec3 d = random.cube();
        ray.direction = dot(d, d) > 0.01f ? d : Vec3{0, 0, 1};
        if (random.chance(0.2)) ray.tmax = longest * float(random.unit());
    }
    return rays;
}

void compare_kernels(Case& c, const TestMesh& made) {
    const BuildOptions build = any_build_options(c.random);
    const WarpTree tree(build_bvh(made.mesh, build), true);
    const std::vector<Ray> rays = ordinary_rays(c.random, made.mesh);
    constexpr int widths[] = {1, 2, 4, 8, 16, 32, 64};
    std::vector<SimulateOptions> runs;
    for (const WarpKernel kernel : warp_kernels())
        runs.push_back({.kernel = kernel,
                        .machine = machine_model("gtx285"),
                        .width = c.random.one_of(widths)});
    std::vector<TreeHit> wanted(rays.size());
    trace_reference(tree, rays, wanted, false, 1);
    std::vector<std::vector<TreeHit>> hits;
    (void)simulate(tree, rays, runs, &hits, 1);
    for (std::size_t k = 0; k < runs.size(); ++k)
        for (std::size_t i = 0; i < rays.size(); ++i)
            c.expect(std::memcmp(&hits[k][i], &wanted[i], sizeof(wanted[i])) == 0, "simulator/hits",
                     text("hit by %s", std::string(warp_kernel_name(runs[k].kernel)).c_str()), [&] {
                         return text("    width %d, family %s\n    ", runs[k].width,
                                     family_name(made.family)) +
                                text_of(build) + "\n" + text_of(rays[i]) + "    reference " +
                                text_of(wanted[i]) + "\n    kernel    " + text_of(hits[k][i]) +
                                "\n" + text_of(made.mesh);
                     });
}

void compare_pictures(Case& c, const TestMesh& made) {
    const Bvh tree = build_bvh(made.mesh, any_build_options(c.random));
    if (tree.empty()) return;
    const Camera camera = fit_camera(tree.bounds());
    RenderOptions options;
    options.view = static_cast<View>(c.random.below(7));
    options.width = 16 + c.random.below(32);
    options.height = 16 + c.random.below(32);
    options.samples = 2;
    options.threads = 1;
    const Picture one = render(tree, camera, options);
    options.threads = 2;
    const Picture two = render(tree, camera, options);
    c.expect(same_bytes(one.pixels, two.pixels), "simulator/pictures",
             "a picture depends on the thread count");
}

}  // namespace

static void attack_simulator(Case& c) {
    constexpr Family families[] = {Family::soup,       Family::grid, Family::voxels,
                                   Family::tetrahedra, Family::fan,  Family::integer_coplanar};
    const TestMesh made = make_mesh(c.random, c.random.one_of(families), 1 + c.random.below(60));
    if (c.random.chance(0.8))
        compare_kernels(c, made);
    else
        compare_pictures(c, made);
}

static const Kind simulator_kind("simulator", attack_simulator, 0.5);

}  // namespace raydix::attack
