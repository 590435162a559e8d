// Refits: a tree whose primitives moved answers as brute force on the moved mesh, bears its check,
// and can be saved.
#include <raydix/check.h>
#include <raydix/double.h>
#include <raydix/error.h>
#include <raydix/refit.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include "attack/attack.h"
#include "attack/brute_all.h"
#include "attack/ray_families.h"
#include "attack/vectors.h"

namespace raydix::attack {
namespace {

/// Turned, sheared and shaken, or shrunk to a point now and then.
Mesh moved(Random& random, const Mesh& mesh) {
    Mesh made = mesh;
    const float shake = random.power_of_ten(-3, 0), shear = random.sign_unit();
    const bool to_point = random.chance(0.05);
    for (Vec3& p : made.vertices) {
        if (!is_finite(p)) continue;
        p = Vec3{p.y * 1.5f, -p.x, p.z + shear * p.x} + random.cube() * shake;
        if (to_point) p = {1, 2, 3};
    }
    return made;
}

void compare_hits(Case& c, const Bvh& tree, const Mesh& mesh, const BuildOptions& options) {
    const std::vector<Ray> rays = make_rays(c.random, mesh, 60);
    const std::vector<Hit> wanted = trace_brute_force(mesh, rays, 1),
                           hits = trace(tree, rays, {.threads = 1}),
                           wide = trace(WideBvh(tree, {.threads = 1}), rays, {.threads = 1});
    const AllHits all = trace_all(tree, rays, {.threads = 1}), wanted_all = brute_all(mesh, rays);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const auto reproducer = [&] {
            return "    " + text_of(options) + "\n" + text_of(rays[i]) + "    brute force " +
                   text_of(wanted[i]) + "\n    the tree    " + text_of(hits[i]) + "\n" +
                   text_of(mesh);
        };
        c.expect(std::memcmp(&hits[i], &wanted[i], sizeof(Hit)) == 0, "refit/rays",
                 "closest after a refit", reproducer);
        c.expect(std::memcmp(&wide[i], &wanted[i], sizeof(Hit)) == 0, "refit/rays",
                 "closest of a wide tree after a refit", reproducer);
    }
    c.expect(same_bytes(all.hits, wanted_all.hits) && same_bytes(all.offsets, wanted_all.offsets),
             "refit/rays", "all hits after a refit");
}

}  // namespace

static void attack_refit(Case& c) {
    const TestMesh made = any_mesh(c.random, 40);
    const BuildOptions options = any_build_options(c.random);
    Bvh tree = build_bvh(made.mesh, options);
    if (tree.has_split_primitives()) {
        try {
            refit(tree, made.mesh, 1);
            c.expect(false, "refit", "a tree with parts of triangles is refused");
        } catch (const InputError&) {
            c.expect(true, "refit", "");
        }
        return;
    }
    const Refitter refitter(tree);
    for (int round = 0; round < 2; ++round) {
        const Mesh now = moved(c.random, made.mesh);
        try {
            refitter.refit(tree, now, c.random.whole(1, 2));
        } catch (const InputError&) {
            // A primitive became invalid, or valid: documented. The tree may be empty now.
            if (!tree.empty()) {
                const CheckReport report = check(tree);
                c.expect(report.ok || round > 0, "refit", "check after a refused refit",
                         [&] { return "    " + report.broken + "\n"; });
            }
            return;
        }
        compare_hits(c, tree, now, options);
        const CheckReport report = check(tree, now);
        c.expect(
            report.ok, "refit",
            text("check after a refit, %s", std::string(builder_name(options.builder)).c_str()),
            [&] {
                return "    " + report.broken + "\n    " + text_of(options) + "\n" + text_of(now);
            });
    }
}

static const Kind refit_kind("refit", attack_refit, 1);

}  // namespace raydix::attack
