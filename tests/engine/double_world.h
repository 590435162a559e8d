// Random scenes in double, and a judge that looks at every mesh and shape on every path.
#pragma once

#include <raydix/double.h>
#include <raydix/scene.h>
#include <raydix/user_geometry.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <tuple>
#include <vector>

#include "engine/affine_double.h"
#include "engine/box_hits.h"
#include "proximity/shape_hits.h"
#include "support/double_scenes.h"
#include "support/support.h"
#include "trace/ray_frame.h"

namespace raydix::test {

/// A scene and what is in it.
struct WorldD {
    struct Item {
        std::uint32_t id = 0, mask = every_mask;
        MeshD mesh;
        TransformD transform;
        std::shared_ptr<const WorldD> inside;  // of an instance
        // Instead of a mesh: shapes.
        std::function<bool(std::uint32_t prim, const RayD& ray, HitD& hit)> intersect = {};
        std::uint32_t shape_count = 0;
        std::vector<CapsuleD> capsules = {};  // what they are, if not a user's; or balls
    };
    std::vector<Item> items;  // by ascending id
    SceneD scene;
    Vec3d home{0, 0, 0};  // what is in it is around there

    [[nodiscard]] std::uint64_t paths() const {
        std::uint64_t sum = 0;
        for (const Item& item : items)
            if (item.inside) sum += 1 + item.inside->paths();
        return sum;
    }
};

inline MeshD one_triangle(double z = 0) {
    MeshD mesh;
    mesh.vertices = {{0, 0, z}, {1, 0, z}, {0, 1, z}};
    mesh.triangles = {{0, 1, 2}};
    return mesh;
}
inline TransformD moved(double x, double y, double z) {
    TransformD t;
    t.m[0][3] = x, t.m[1][3] = y, t.m[2][3] = z;
    return t;
}
/// Through that triangle.
inline constexpr RayD down{{0.25, 0.25, 10}, 0, {0, 0, -1}};

struct RecipeD {
    std::uint32_t levels, items;
    double shear = 0, distance = 0;  // of homes from the origin
    SceneOptions options = {};
    bool shapes = false;  // among the meshes
    bool users = true;    // a user's own among the shapes
};

class RandomWorlds : public RandomD {
public:
    using RandomD::RandomD;
    std::uint32_t under(std::uint32_t n) { return static_cast<std::uint32_t>(below(n)); }
    std::uint32_t mask() { return below(3) == 0 ? 1u << below(3) : every_mask; }
    Vec3d around(Vec3d at, double reach) {
        return at + in({{-reach, -reach, -reach}, {reach, reach, reach}});
    }
    MeshD soup(std::uint32_t most, Vec3d home) {
        return in_double_at(random_soup_d(1 + under(most), below(1000), 0.6), home);
    }
    /// Turned, stretched, mirrored or not, stretched once more by up to `shear`; `home` comes to
    /// lie near `to`.
    TransformD transform(Vec3d home, Vec3d to, double reach, double shear) {
        for (;;) {
            TransformD t;
            for (auto& row : t.m)
                for (std::size_t k = 0; k < 3; ++k) row[k] = between(-1, 1);
            if (shear > 1) {
                const std::uint32_t into = under(3), from = (into + 1 + under(2)) % 3;
                for (std::size_t k = 0; k < 3; ++k)
                    t.m[into][k] += between(-shear, shear) * t.m[from][k];
            }
            const Vec3d at = around(to, reach);
            const double wanted[3] = {at.x, at.y, at.z};
            for (std::size_t a = 0; a < 3; ++a)
                t.m[a][3] =
                    wanted[a] - (t.m[a][0] * home.x + t.m[a][1] * home.y + t.m[a][2] * home.z);
            if (inverse_of(affine_of(t))) return t;
        }
    }
    std::shared_ptr<WorldD> world(const RecipeD& recipe, std::uint32_t level = 0) {
        auto world = std::make_shared<WorldD>();
        if (level == 0 || below(2) == 0)
            world->home = {recipe.distance, -0.7 * recipe.distance, 0.1 * recipe.distance};
        std::vector<std::shared_ptr<WorldD>> inner;
        if (level < recipe.levels)
            for (int k = 0; k < 2; ++k) inner.push_back(this->world(recipe, level + 1));
        std::uint32_t id = 0;
        for (std::uint32_t k = 0; k < recipe.items; ++k, ++id) {
            WorldD::Item item{id, mask(), {}, {}, {}};
            if (below(4) == 0) item.id = id += 1 + under(5);
            const GeometryOptions options{item.mask, item.id};
            if (!inner.empty() && below(3) != 0) {
                item.inside = inner[below(2)];
                item.transform =
                    transform(item.inside->home, world->home, level == 0 ? 4 : 2, recipe.shear);
                world->scene.add(item.inside->scene, item.transform, options);
            } else if (recipe.shapes && below(3) != 0) {
                add_shapes(*world, item, options, recipe.users);
            } else {
                if (below(8) != 0) item.mesh = soup(40, world->home);
                world->scene.add(item.mesh, options);
            }
            world->items.push_back(std::move(item));
        }
        world->scene.commit(recipe.options);
        return world;
    }
    std::vector<RayD> rays(std::size_t count, Vec3d home) {
        constexpr double nan = std::numeric_limits<double>::quiet_NaN();
        std::vector<RayD> out;
        for (std::size_t i = 0; i < count; ++i) {
            const Vec3d from = around(home, i % 3 == 0 ? 6 : 2.5),
                        to = around(home, i % 2 == 0 ? 1 : 3);
            RayD ray{from, 0, (i % 11 == 0 ? 100.0 : 1.0) * (to - from)};
            if (i % 5 == 0) ray.tmax = between(0.2, 1.0);
            if (i % 7 == 0) ray.tmin = between(0.0, 0.5);
            if (i % 97 == 0) ray.direction = {0, 0, 0};
            if (i % 89 == 0) ray.origin.x = nan;
            out.push_back(ray);
        }
        return out;
    }

private:
    /// Spheres, capsules, points or boxes of a user's own; some twice, some without a radius.
    void add_shapes(WorldD& world, WorldD::Item& item, const GeometryOptions& options, bool users) {
        const std::uint32_t count = 1 + under(40), kind = under(users ? 4 : 3);
        item.shape_count = count;
        const double one = below(10) == 0 ? 0.0 : between(0.01, 0.3);
        std::vector<CapsuleD> all;
        for (std::uint32_t k = 0; k < count; ++k) {
            const Vec3d a = around(world.home, 0.6);
            const double radius = below(10) == 0 ? 0.0 : between(0.01, 0.3);
            all.push_back({a, kind == 1 ? around(world.home, 0.6) : a, kind == 2 ? one : radius});
            if (k % 8 == 7) all.back() = all[k - 1];
        }
        if (kind == 0) {
            const auto spheres = std::make_shared<std::vector<SphereD>>();
            for (const CapsuleD& c : all) spheres->push_back({c.a, c.radius});
            item.intersect = [spheres](std::uint32_t prim, const RayD& ray, HitD& hit) {
                return hit_ball((*spheres)[prim].center, (*spheres)[prim].radius, ray, hit);
            };
            world.scene.add(std::span<const SphereD>(*spheres), options);
        } else if (kind == 1) {
            const auto capsules = std::make_shared<std::vector<CapsuleD>>(all);
            item.intersect = [capsules](std::uint32_t prim, const RayD& ray, HitD& hit) {
                return hit_capsule((*capsules)[prim], ray, hit);
            };
            world.scene.add(std::span<const CapsuleD>(*capsules), options);
        } else if (kind == 2) {
            const auto points = std::make_shared<std::vector<Vec3d>>();
            for (const CapsuleD& c : all) points->push_back(c.a);
            item.intersect = [points, one](std::uint32_t prim, const RayD& ray, HitD& hit) {
                return hit_ball((*points)[prim], one, ray, hit);
            };
            world.scene.add(std::span<const Vec3d>(*points), one, options);
        } else {
            const auto boxes = std::make_shared<std::vector<AabbD>>();
            for (const CapsuleD& c : all)
                boxes->push_back({c.a, c.a + in({{0, 0, 0}, {0.3, 0.3, 0.3}})});
            item.intersect = [boxes](std::uint32_t prim, const RayD& ray, HitD& hit) {
                return hits_box((*boxes)[prim], ray, hit);
            };
            world.scene.add(UserGeometryD(*boxes, item.intersect), options);
            return;
        }
        item.capsules = std::move(all);
    }
    static MeshD in_double_at(MeshD mesh, Vec3d home) {
        for (Vec3d& v : mesh.vertices) v = v + home;
        return mesh;
    }
};

inline auto key_of(const HitD& hit) {
    return std::tuple(hit.t, hit.instance, hit.geometry, hit.prim);
}

/// What each shape on its own says, in order of primitives.
inline std::vector<HitD> hits_of_shapes(const WorldD::Item& item, RayD ray) {
    std::vector<HitD> hits;
    if (!is_valid(ray)) return hits;
    ray.tmin = std::max(ray.tmin, 0.0) + 0.0;
    for (std::uint32_t prim = 0; prim < item.shape_count; ++prim) {
        HitD hit;
        if (!item.intersect(prim, ray, hit)) continue;
        hit.t += 0.0;  // -0 becomes +0
        hit.prim = prim;
        hits.push_back(hit);
    }
    return hits;
}
/// The least hit of each ray.
inline std::vector<HitD> closest_in(const WorldD::Item& item, const std::vector<RayD>& rays) {
    if (item.shape_count == 0) return trace_brute_force(item.mesh, rays, 1);
    std::vector<HitD> best(rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i)
        for (const HitD& hit : hits_of_shapes(item, rays[i]))
            if (!best[i].hit() || hit.t < best[i].t) best[i] = hit;
    return best;
}

/// Calls meet(item, rays as they come in, number of the path) for each mesh on each path that
/// `mask` sees.
template <class Meet>
void for_each_mesh(const WorldD& world, std::span<const RayD> rays, std::uint32_t mask,
                   const Meet& meet) {
    const std::function<void(const WorldD&, const std::vector<LineD>&, std::uint32_t)> visit =
        [&](const WorldD& at, const std::vector<LineD>& lines, std::uint32_t number) {
            std::uint32_t next = number + 1;
            for (const WorldD::Item& item : at.items) {
                const bool seen = (item.mask & mask) != 0;
                if (item.inside) {
                    const InverseD inverse = *inverse_of(affine_of(item.transform));
                    std::vector<LineD> inner;
                    for (const LineD& line : lines) inner.push_back(line.into(inverse));
                    if (seen) visit(*item.inside, inner, next);
                    next += 1 + static_cast<std::uint32_t>(item.inside->paths());
                } else if (seen) {
                    std::vector<RayD> entering;
                    for (std::size_t i = 0; i < rays.size(); ++i)
                        entering.push_back(lines[i].ray(rays[i].tmin, rays[i].tmax));
                    meet(item, entering, number);
                }
            }
        };
    visit(world, std::vector<LineD>(rays.begin(), rays.end()), 0);
}

/// The least hit of each ray.
inline std::vector<HitD> look(const WorldD& world, std::span<const RayD> rays, std::uint32_t mask) {
    std::vector<HitD> best(rays.size());
    for_each_mesh(
        world, rays, mask,
        [&](const WorldD::Item& item, const std::vector<RayD>& entering, std::uint32_t number) {
            const std::vector<HitD> hits = closest_in(item, entering);
            for (std::size_t i = 0; i < rays.size(); ++i) {
                if (!hits[i].hit()) continue;
                const HitD found{hits[i], item.id, number};
                if (!best[i].hit() || key_of(found) < key_of(best[i])) best[i] = found;
            }
        });
    return best;
}

/// All hits of each ray, in order.
inline std::vector<std::vector<HitD>> look_for_all(const WorldD& world, std::span<const RayD> rays,
                                                   std::uint32_t mask) {
    std::vector<std::vector<HitD>> rows(rays.size());
    for_each_mesh(
        world, rays, mask,
        [&](const WorldD::Item& item, const std::vector<RayD>& entering, std::uint32_t number) {
            for (std::size_t i = 0; i < rays.size() && item.shape_count != 0; ++i)
                for (const HitD& hit : hits_of_shapes(item, entering[i]))
                    rows[i].push_back({hit, item.id, number});
            if (item.mesh.triangles.empty()) return;
            const AllHitsD all = trace_all(build_bvh(item.mesh), entering, {.threads = 1});
            for (std::size_t i = 0; i < rays.size(); ++i)
                for (std::uint64_t k = all.offsets[i]; k < all.offsets[i + 1]; ++k)
                    rows[i].push_back({all.hits[k], item.id, number});
        });
    for (auto& row : rows) std::ranges::sort(row, {}, key_of);
    return rows;
}

/// How many answers differ from those of the judge. Rays take masks of their own in turn.
inline std::size_t differences(const WorldD& world, std::span<const RayD> rays,
                               const std::vector<std::uint32_t>& masks) {
    std::vector<HitD> wanted(rays.size());
    std::vector<std::uint32_t> distinct = masks;
    std::ranges::sort(distinct);
    distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
    for (const std::uint32_t mask : distinct) {
        const std::vector<HitD> seen = look(world, rays, mask);
        for (std::size_t i = 0; i < rays.size(); ++i)
            if (masks[i] == mask) wanted[i] = seen[i];
    }
    std::size_t wrong = 0;
    for (const int threads : {1, 2}) {
        SceneTraceOptionsD options;
        options.masks = masks, options.threads = threads;
        const std::vector<HitD> hits = trace(world.scene, rays, options);
        std::vector<std::uint8_t> occluded(rays.size(), 7);
        const TraceCounts counts = trace_any(world.scene, rays, occluded, options);
        wrong += counts.hits !=
                 static_cast<std::uint64_t>(std::ranges::count(occluded, std::uint8_t{1}));
        for (std::size_t i = 0; i < rays.size(); ++i) {
            wrong += hits[i] != wanted[i];
            wrong += occluded[i] != (wanted[i].hit() ? 1 : 0);
        }
    }
    for (std::size_t i = 0; i < rays.size(); ++i) {
        wrong += closest_hit(world.scene, rays[i], masks[i]) != wanted[i];
        wrong += any_hit(world.scene, rays[i], masks[i]) != wanted[i].hit();
    }
    return wrong;
}

/// Rays that end, or begin, where they hit: the bounds of boxes decide.
inline std::vector<RayD> rays_to_hits(std::span<const RayD> rays, std::span<const HitD> hits) {
    std::vector<RayD> out;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!hits[i].hit()) continue;
        for (int k = 0; k < 3; ++k) {
            out.push_back(rays[i]);
            if (k != 1) out.back().tmax = hits[i].t;
            if (k != 0) out.back().tmin = hits[i].t;
        }
    }
    return out;
}

/// With rays of its own, that begin and end anywhere and at hits.
inline std::size_t differences_with_ends(const WorldD& world, RandomWorlds& random,
                                         std::size_t count, std::size_t& hit_count) {
    const std::vector<RayD> rays = random.rays(count, world.home);
    std::vector<std::uint32_t> masks;
    for (std::size_t i = 0; i < rays.size(); ++i) masks.push_back(random.mask());
    std::size_t wrong = differences(world, rays, masks);
    const std::vector<HitD> hits = look(world, rays, every_mask);
    for (const HitD& hit : hits) hit_count += hit.hit();
    const std::vector<RayD> ends = rays_to_hits(rays, hits);
    return wrong + differences(world, ends, std::vector<std::uint32_t>(ends.size(), every_mask));
}

}  // namespace raydix::test
