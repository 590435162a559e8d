// Rays that start inside closed meshes must hit, whatever they are aimed at: through wide trees, as
// many as the time allows.
#include <raydix/trace.h>
#include <raydix/wide.h>

#include "attack/attack.h"
#include "attack/vectors.h"

namespace raydix::attack {
namespace {

/// A closed mesh around a point that all of it can be seen from, some thousand roundings inside.
struct Shell {
    Mesh mesh;
    Vec3 middle;
    float room;  // the surface is at least this far from `middle` along every axis
};

Shell make_shell(Random& random) {
    const std::uint32_t side = 4 + random.below(60);
    Shell shell{make_sphere(side, side, {0, 0, 0}, {1, 1, 1}), {0, 0, 0}, 0.3f};
    for (Vec3& p : shell.mesh.vertices) p = p * random.between(0.8f, 1.5f);
    Vec3 stretch{1, 1, 1};
    at(stretch, random.below(3)) = random.power_of_ten(0, 4);
    const float scale = random.power_of_ten(-6, 6);
    const Vec3 move = random.cube() * random.power_of_ten(-1, 2);
    const auto place = [&](Vec3 p) {
        return Vec3{p.x * stretch.x + move.x, p.y * stretch.y + move.y, p.z * stretch.z + move.z} *
               scale;
    };
    for (Vec3& p : shell.mesh.vertices) p = place(p);
    shell.middle = place({0, 0, 0});
    shell.room *= scale;
    return shell;
}

Ray make_inside_ray(Random& random, const Shell& shell) {
    const Vec3 from = shell.middle + random.cube() * (0.3f * shell.room);
    const auto& vertices = shell.mesh.vertices;
    const Triangle& t = shell.mesh.triangles[random.below(shell.mesh.triangles.size())];
    switch (random.below(4)) {
        case 0: {
            const Vec3 d = random.cube();
            return {from, 0, dot(d, d) > 0.01f ? d : Vec3{1, 0, 0}, infinity};
        }
        case 1:
            return {from, 0, vertices[t[0]] - from, infinity};
        case 2: {
            Vec3 d{0, 0, 0};
            at(d, random.below(3)) = random.chance(0.5) ? 1.0f : -1.0f;
            return {from, 0, d, infinity};
        }
        default:
            return {from, 0, (vertices[t[0]] + vertices[t[1]]) * 0.5f - from, infinity};
    }
}

}  // namespace

static void attack_watertight(Case& c) {
    const Shell shell = make_shell(c.random);
    const BuildOptions build = any_build_options(c.random);
    const WideBvh tree =
        build_wide_bvh(shell.mesh, build,
                       {.width = c.random.chance(0.5) ? 8 : 4, .compact = c.random.chance(0.3)});
    std::vector<Ray> rays(4096);
    for (Ray& ray : rays) ray = make_inside_ray(c.random, shell);
    std::vector<Hit> hits(rays.size());
    std::vector<std::uint8_t> occluded(rays.size());
    TraceOptions options{.threads = 1};
    options.path = static_cast<SimdPath>(c.random.below(5));
    // The same targets from many places: making a ray takes longer than tracing it.
    for (int round = 0; round < 32; ++round) {
        const Vec3 step = c.random.cube() * (0.1f * shell.room);
        for (Ray& ray : rays) {
            const Vec3 target = ray.origin + ray.direction;
            ray.origin = ray.origin + step;
            if (dot(ray.direction, ray.direction) != 1.0f) ray.direction = target - ray.origin;
        }
        trace(tree, rays, hits, options);
        trace_any(tree, rays, occluded, options);
        c.compared("watertight", 2 * rays.size());
        for (std::size_t i = 0; i < rays.size(); ++i)
            if (!hits[i].hit() || occluded[i] == 0)
                c.found(text("a ray slips out, %s", hits[i].hit() ? "any" : "closest"),
                        c.wants("a ray slips out, closest")
                            ? "    " + text_of(build) + "\n" + text_of(rays[i])
                            : std::string());
        // Places wander; half of the room is never left.
        for (Ray& ray : rays) {
            const Vec3 target = ray.origin + ray.direction;
            ray.origin = ray.origin - step;
            if (dot(ray.direction, ray.direction) != 1.0f) ray.direction = target - ray.origin;
        }
    }
}

static const Kind watertight_kind("watertight", attack_watertight, 1);

}  // namespace raydix::attack
