// Rays in double through trees of every builder against brute force, and brute force against
// whole-number crossings.
#include <raydix/double.h>

#include "attack/attack.h"
#include "attack/brute_all.h"
#include "attack/precision.h"

namespace raydix::attack {
namespace {

bool same(const HitD& a, const HitD& b) { return a == b && std::signbit(a.t) == std::signbit(b.t); }

/// The rays with a limit at the t of their hit.
void add_tightened(Random& random, std::vector<RayD>& rays, const std::vector<HitD>& hits) {
    const std::size_t count = rays.size();
    for (std::size_t i = 0; i < count; ++i) {
        if (!hits[i].hit() || random.chance(0.5)) continue;
        RayD ray = rays[i];
        if (random.chance(0.5)) ray.tmin = hits[i].t;
        if (random.chance(0.7)) ray.tmax = hits[i].t;
        if (random.chance(0.2)) ray.tmax = std::nextafter(hits[i].t, 0.0);
        rays.push_back(ray);
    }
}

}  // namespace

static void attack_doubles(Case& c) {
    const Scenery<InDouble> scenery(c.random, any_mesh(c.random, 50));
    std::vector<RayD> rays = scenery.rays(c.random, 120);
    add_tightened(c.random, rays, trace_brute_force(scenery.mesh, rays, 1));
    const std::vector<HitD> wanted = trace_brute_force(scenery.mesh, rays, 1);
    const AllHitsD wanted_all = brute_all(MeshViewD(scenery.mesh), rays);
    for (const BuildOptions& build : every_builder(c.random)) {
        const BvhD tree = build_bvh(scenery.mesh, build);
        const std::vector<HitD> closest = trace(tree, rays, {.threads = 1});
        std::vector<std::uint8_t> any(rays.size());
        trace_any(tree, rays, any, {.threads = 1});
        const AllHitsD all = trace_all(tree, rays, {.threads = 1});
        for (std::size_t i = 0; i < rays.size(); ++i) {
            const auto expect = [&](bool right, const char* what) {
                c.expect(right, "doubles/rays",
                         text("%s by %s", what, std::string(builder_name(build.builder)).c_str()),
                         [&] {
                             return "    " + text_of(build) +
                                    text(", family %s\n", family_name(scenery.family)) +
                                    text_of(rays[i]) + "    brute force " + text_of(wanted[i]) +
                                    "\n    the tree    " + text_of(closest[i]) + "\n" +
                                    text_of(scenery.mesh);
                         });
            };
            expect(same(closest[i], wanted[i]), "closest");
            expect((any[i] != 0) == wanted[i].hit(), "any");
            const std::size_t first = all.offsets[i], count = all.offsets[i + 1] - first,
                              from = wanted_all.offsets[i];
            bool right = count == wanted_all.offsets[i + 1] - from;
            for (std::size_t k = 0; right && k < count; ++k)
                right = same(all.hits[first + k], wanted_all.hits[from + k]);
            expect(right, "all");
            if (i % 8 != 0) continue;
            expect(same(closest_hit(tree, rays[i]), wanted[i]), "single closest");
            expect(any_hit(tree, rays[i]) == wanted[i].hit(), "single any");
        }
    }
}

static const Kind doubles_kind("doubles", attack_doubles, 1);

}  // namespace raydix::attack
