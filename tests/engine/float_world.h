// Random scenes in float, and a judge that looks at every mesh and shape on every path.
#pragma once

#include <raydix/scene.h>
#include <raydix/trace.h>
#include <raydix/user_geometry.h>
#include <raydix/wide.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "engine/affine.h"
#include "engine/box_hits.h"
#include "proximity/shape_hits.h"
#include "support/random.h"
#include "support/support.h"
#include "trace/ray_frame.h"

namespace raydix::test {

class RandomScenes : public Random {
public:
    using Random::Random;
    std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>(Random::below(n)); }
    /// Turned, stretched, mirrored or not, moved; stretched once more by up to `shear`.
    Transform transform(float reach, float shear) {
        Transform t;
        for (auto& row : t.m) {
            for (std::size_t k = 0; k < 3; ++k) row[k] = between(-1, 1);
            row[3] = between(-reach, reach);
        }
        if (shear > 1) {
            const std::uint32_t to = below(3), from = (to + 1 + below(2)) % 3;
            for (std::size_t k = 0; k < 3; ++k) t.m[to][k] += between(-shear, shear) * t.m[from][k];
        }
        return inverse_of(affine_of(t)) ? t : transform(reach, shear);
    }
    std::uint32_t mask() { return below(3) == 0 ? 1u << below(3) : every_mask; }
};

/// A scene and what is in it, for a judge that looks at everything.
struct World {
    struct Item {
        std::uint32_t id, mask;
        Mesh mesh;
        Transform transform;
        std::shared_ptr<const World> inside;  // of an instance
        // Instead of a mesh: shapes.
        std::function<bool(std::uint32_t prim, const Ray& ray, Hit& hit)> intersect = {};
        std::uint32_t shape_count = 0;
    };
    std::vector<Item> items;  // by ascending id
    Scene scene;

    [[nodiscard]] std::uint64_t paths() const {
        std::uint64_t sum = 0;
        for (const Item& item : items)
            if (item.inside) sum += 1 + item.inside->paths();
        return sum;
    }
};

struct Sight {
    std::vector<Hit> hits;
    std::vector<std::uint32_t> masks;
};

/// What each shape on its own says.
inline Hit closest_shape(const World::Item& item, Ray ray) {
    Hit best;
    if (!is_valid(ray)) return best;
    ray.tmin = std::max(ray.tmin, 0.0f);
    for (std::uint32_t prim = 0; prim < item.shape_count; ++prim) {
        Hit hit;
        if (!item.intersect(prim, ray, hit)) continue;
        hit.t += 0.0f;  // -0 becomes +0
        if (best.hit() && best.t <= hit.t) continue;
        best = hit;
        best.prim = prim;
    }
    return best;
}

/// All of `world`, seen by `lines`; `number`: of the path that leads here.
inline void look(const World& world, const std::vector<WideRayLine>& lines,
                 const std::vector<bool>& sees, std::span<const Ray> rays, std::uint32_t number,
                 Sight& sight) {
    std::uint32_t next = number + 1;
    for (const World::Item& item : world.items) {
        std::vector<bool> seen(rays.size());
        for (std::size_t i = 0; i < rays.size(); ++i)
            seen[i] = sees[i] && (item.mask & sight.masks[i]) != 0;
        if (item.inside) {
            const Affine inverse = *inverse_of(affine_of(item.transform));
            std::vector<WideRayLine> inner;
            for (const WideRayLine& line : lines) inner.push_back(line.into(inverse));
            look(*item.inside, inner, seen, rays, next, sight);
            next += 1 + static_cast<std::uint32_t>(item.inside->paths());
            continue;
        }
        std::vector<Ray> entering;
        for (std::size_t i = 0; i < rays.size(); ++i)
            entering.push_back(lines[i].rounded(rays[i].tmin, rays[i].tmax));
        std::vector<Hit> hits;
        if (item.shape_count == 0) {
            hits = trace_brute_force(item.mesh, entering, 1);
        } else {
            for (const Ray& ray : entering) hits.push_back(closest_shape(item, ray));
        }
        for (std::size_t i = 0; i < rays.size(); ++i) {
            if (!seen[i] || !hits[i].hit()) continue;
            const Hit found{hits[i], item.id, number};
            Hit& best = sight.hits[i];
            const auto key = [](const Hit& h) {
                return std::tuple(h.t, h.instance, h.geometry, h.prim);
            };
            if (!best.hit() || key(found) < key(best)) best = found;
        }
    }
}

inline Sight look(const World& world, std::span<const Ray> rays, std::vector<std::uint32_t> masks) {
    Sight sight{std::vector<Hit>(rays.size()), std::move(masks)};
    std::vector<WideRayLine> lines;
    for (const Ray& ray : rays) lines.push_back({Double3(ray.origin), Double3(ray.direction)});
    look(world, lines, std::vector<bool>(rays.size(), true), rays, 0, sight);
    return sight;
}

inline bool same(const Hit& a, const Hit& b) {
    return a.t == b.t && a.prim == b.prim && a.u == b.u && a.v == b.v && a.geometry == b.geometry &&
           a.instance == b.instance;
}

struct Recipe {
    std::uint32_t levels, items;
    float shear;
    SceneOptions options = {};
    bool shapes = false;  // among the meshes
    bool flats = false;   // triangles without area, and some twice, in meshes
};

/// Triangles that are segments or points, and some that are there already.
inline void add_flats(RandomScenes& random, Mesh& mesh) {
    const auto vertices = static_cast<std::uint32_t>(mesh.vertices.size());
    if (vertices == 0) return;
    for (std::uint32_t k = random.below(12); k-- > 0;) {
        const std::uint32_t a = random.below(vertices), b = random.below(vertices);
        const std::uint32_t kind = random.below(4);
        if (kind == 0) mesh.triangles.push_back({a, a, b});
        if (kind == 1) mesh.triangles.push_back({a, a, a});
        if (kind == 2) mesh.triangles.push_back(mesh.triangles[random.below(3) % vertices / 3]);
        if (kind == 3) {
            const Vec3 at = random.in(-1, 2);
            for (int step = 0; step < 3; ++step)
                mesh.vertices.push_back({at.x + static_cast<float>(step), at.y, at.z});
            const auto end = static_cast<std::uint32_t>(mesh.vertices.size());
            mesh.triangles.push_back({end - 3, end - 1, end - 2});
        }
    }
}

/// Spheres, capsules, points or boxes of a user's own; some twice. Keeps what it is made of.
inline void add_random_shapes(RandomScenes& random, World& world, World::Item& item,
                              const GeometryOptions& options) {
    const std::uint32_t count = 1 + random.below(40);
    item.shape_count = count;
    const auto radius = [&] { return random.below(10) == 0 ? 0.0f : random.between(0.01f, 0.3f); };
    const auto again = [&](std::uint32_t k) { return k % 8 == 7; };
    switch (random.below(4)) {
        case 0: {
            const auto all = std::make_shared<std::vector<Sphere>>();
            for (std::uint32_t k = 0; k < count; ++k)
                all->push_back(again(k) ? all->back() : Sphere{random.in(0, 1), radius()});
            item.intersect = [all](std::uint32_t prim, const Ray& ray, Hit& hit) {
                return hit_ball((*all)[prim].center, (*all)[prim].radius, ray, hit);
            };
            world.scene.add(std::span<const Sphere>(*all), options);
            break;
        }
        case 1: {
            const auto all = std::make_shared<std::vector<Capsule>>();
            for (std::uint32_t k = 0; k < count; ++k)
                all->push_back(again(k) ? all->back()
                                        : Capsule{random.in(0, 1), random.in(0, 1), radius()});
            item.intersect = [all](std::uint32_t prim, const Ray& ray, Hit& hit) {
                return hit_capsule((*all)[prim], ray, hit);
            };
            world.scene.add(std::span<const Capsule>(*all), options);
            break;
        }
        case 2: {
            const auto all = std::make_shared<std::vector<Vec3>>();
            for (std::uint32_t k = 0; k < count; ++k)
                all->push_back(again(k) ? all->back() : random.in(0, 1));
            const float one = radius();
            item.intersect = [all, one](std::uint32_t prim, const Ray& ray, Hit& hit) {
                return hit_ball((*all)[prim], one, ray, hit);
            };
            world.scene.add(std::span<const Vec3>(*all), one, options);
            break;
        }
        default: {
            const auto all = std::make_shared<std::vector<Aabb>>();
            for (std::uint32_t k = 0; k < count; ++k) {
                const Vec3 lo = random.in(0, 1), by = random.in(0, 0.3f);
                all->push_back(again(k) ? all->back()
                                        : Aabb{lo, {lo.x + by.x, lo.y + by.y, lo.z + by.z}});
            }
            item.intersect = [all](std::uint32_t prim, const Ray& ray, Hit& hit) {
                return hits_box((*all)[prim], ray, hit);
            };
            world.scene.add(UserGeometry(*all, item.intersect), options);
        }
    }
}

inline std::shared_ptr<World> random_world(RandomScenes& random, const Recipe& recipe,
                                           std::uint32_t level = 0) {
    auto world = std::make_shared<World>();
    std::vector<std::shared_ptr<World>> inner;
    if (level < recipe.levels)
        for (int k = 0; k < 2; ++k) inner.push_back(random_world(random, recipe, level + 1));
    std::uint32_t id = 0;
    for (std::uint32_t k = 0; k < recipe.items; ++k, ++id) {
        World::Item item{id, random.mask(), {}, {}, {}};
        if (random.below(4) == 0) item.id = id += 1 + random.below(5);
        const GeometryOptions options{item.mask, item.id};
        if (!inner.empty() && random.below(3) != 0) {
            item.inside = inner[random.below(2)];
            item.transform = random.transform(level == 0 ? 4.0f : 2.0f, recipe.shear);
            world->scene.add(item.inside->scene, item.transform, options);
        } else if (recipe.shapes && random.below(3) != 0) {
            add_random_shapes(random, *world, item, options);
        } else {
            item.mesh = random.below(8) == 0
                            ? Mesh{}
                            : random_soup(1 + random.below(40), id + 100 * level, 0.6f);
            if (recipe.flats) add_flats(random, item.mesh);
            world->scene.add(item.mesh, options);
        }
        world->items.push_back(std::move(item));
    }
    world->scene.commit(recipe.options);
    return world;
}

inline std::vector<Ray> random_rays(RandomScenes& random, std::size_t count) {
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 from = i % 3 == 0 ? random.in(-6, 6) : random.in(-2, 3),
                   to = i % 2 == 0 ? random.in(0, 1) : random.in(-3, 3);
        const Vec3 way{to.x - from.x, to.y - from.y, to.z - from.z};
        Ray ray{from, 0, i % 11 == 0 ? Vec3{way.x * 100, way.y * 100, way.z * 100} : way};
        if (i % 5 == 0) ray.tmax = random.between(0.2f, 1.0f);
        if (i % 7 == 0) ray.tmin = random.between(0.0f, 0.5f);
        if (i % 97 == 0) ray.direction = {0, 0, 0};
        if (i % 89 == 0) ray.origin.x = std::numeric_limits<float>::quiet_NaN();
        rays.push_back(ray);
    }
    return rays;
}

/// Bundles of rays that go much the same way, so that many reach a part together.
inline std::vector<Ray> bundles_of_rays(RandomScenes& random, std::size_t bundles,
                                        std::size_t rays_each) {
    std::vector<Ray> rays;
    for (std::size_t b = 0; b < bundles; ++b) {
        const Ray middle{random.in(-6, 6), 0, {}, infinity};
        const Vec3 to = random.in(0, 1);
        for (std::size_t k = 0; k < rays_each; ++k) {
            Ray ray = middle;
            ray.direction = to + 0.2f * random.in(-1, 1) - middle.origin;
            if (k % 3 == 0) ray.tmax = random.between(0.5f, 1.5f);
            rays.push_back(ray);
        }
    }
    return rays;
}

/// Rays that end, or begin, where they hit: the bounds of boxes decide.
inline std::vector<Ray> rays_to_hits(std::span<const Ray> rays, std::span<const Hit> hits) {
    std::vector<Ray> out;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!hits[i].hit()) continue;
        out.push_back(rays[i]);
        out.back().tmax = hits[i].t;
        out.push_back(rays[i]);
        out.back().tmin = hits[i].t;
        out.push_back(out.back());
        out.back().tmax = hits[i].t;
    }
    return out;
}

/// How many answers differ from those of the judge, every way through the scene.
inline std::size_t differences(const World& world, std::span<const Ray> rays,
                               const std::vector<std::uint32_t>& masks) {
    const Sight sight = look(world, rays, masks);
    std::size_t wrong = 0;
    for (const std::string& isa : simd_instruction_sets()) {
        for (const SimdPath path : {SimdPath::automatic, SimdPath::single, SimdPath::packet,
                                    SimdPath::stream, SimdPath::sorted}) {
            SceneTraceOptions options;
            options.masks = masks, options.isa = isa, options.path = path;
            options.threads = 1 + static_cast<int>(path) % 2;
            const std::vector<Hit> hits = trace(world.scene, rays, options);
            std::vector<std::uint8_t> occluded(rays.size(), 7);
            trace_any(world.scene, rays, occluded, options);
            for (std::size_t i = 0; i < rays.size(); ++i) {
                wrong += !same(hits[i], sight.hits[i]);
                wrong += occluded[i] != (sight.hits[i].hit() ? 1 : 0);
            }
        }
    }
    for (std::size_t i = 0; i < rays.size(); ++i) {
        wrong += !same(closest_hit(world.scene, rays[i], masks[i]), sight.hits[i]);
        wrong += any_hit(world.scene, rays[i], masks[i]) != sight.hits[i].hit();
    }
    return wrong;
}

inline std::size_t differences_with_ends(const World& world, RandomScenes& random,
                                         std::size_t count, std::size_t& hit_count) {
    const std::vector<Ray> rays = random_rays(random, count);
    std::vector<std::uint32_t> masks;
    for (std::size_t i = 0; i < rays.size(); ++i) masks.push_back(i % 16 == 15 ? 0 : random.mask());
    std::size_t wrong = differences(world, rays, masks);
    const Sight sight = look(world, rays, std::vector<std::uint32_t>(rays.size(), every_mask));
    for (const Hit& hit : sight.hits) hit_count += hit.hit();
    const std::vector<Ray> ends = rays_to_hits(rays, sight.hits);
    return wrong + differences(world, ends, std::vector<std::uint32_t>(ends.size(), every_mask));
}

inline Mesh one_triangle(float z) {
    Mesh mesh;
    mesh.vertices = {{0, 0, z}, {1, 0, z}, {0, 1, z}};
    mesh.triangles = {{0, 1, 2}};
    return mesh;
}
inline Transform moved(float x, float y, float z) {
    Transform t;
    t.m[0][3] = x, t.m[1][3] = y, t.m[2][3] = z;
    return t;
}

}  // namespace raydix::test
