// Instances at the edges of their maps, in float and in double: nearly flat ones, far places, rays
// from far away, long and short directions; and the sums that boxes of instances rest on, against
// exact arithmetic.
#include <gtest/gtest.h>
#include <raydix/double.h>
#include <raydix/scene.h>
#include <raydix/trace.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <iostream>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "engine/affine.h"
#include "engine/affine_double.h"
#include "support/double_scenes.h"
#include "support/exact.h"
#include "support/random.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t instance_edges_seed = 20151102;
constexpr double inf = std::numeric_limits<double>::infinity();

/// Turned, stretched, sheared; mirrored every other time. `flat` < 1: the last row is the first but
/// for that much, so that the map nearly flattens and its inverse stretches what rounding did.
TransformD random_transform(RandomD& random, Vec3d place, double reach, double flat = 1.0) {
    TransformD t;
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t k = 0; k < 3; ++k) {
            t.m[i][k] = random.between(-1, 1);
            if (i == 2 && flat < 1.0) t.m[i][k] = t.m[0][k] + flat * t.m[i][k];
        }
        t.m[i][3] = (i == 0 ? place.x : i == 1 ? place.y : place.z) + random.between(-reach, reach);
    }
    return inverse_of(affine_of(t)) ? t : random_transform(random, place, reach, flat);
}

/// What a scene shows, as a list.
struct Shown {
    const BvhD* bvh;
    std::vector<InverseD> inverses;  // from the scene inward
    std::vector<std::uint32_t> masks;
    std::uint32_t number = 0;  // of the path
};

HitD look_at_all(const std::vector<Shown>& all, const RayD& ray, std::uint32_t mask) {
    HitD best;
    for (const Shown& shown : all) {
        bool seen = true;
        LineD line(ray);
        for (std::size_t k = 0; k < shown.inverses.size(); ++k) {
            seen = seen && (shown.masks[k] & mask) != 0;
            line = line.into(shown.inverses[k]);
        }
        if (!seen) continue;
        const HitD hit = closest_hit(*shown.bvh, line.ray(ray.tmin, ray.tmax));
        if (!hit.hit()) continue;
        if (!best.hit() || hit.t < best.t || (hit.t == best.t && shown.number < best.instance))
            best = {hit, 0, shown.number};
    }
    return best;
}

/// Scenes within scenes, placed by maps of which every third nearly flattens; and the same as a
/// list.
class Nest {
public:
    Nest(Vec3d place, double reach, double flat, std::size_t count) {
        RandomD random(instance_edges_seed);
        for (const MeshD& mesh :
             {random_soup_d(200, 1, 0.5), in_double(ball_mesh({0, 0, 0}), 0.01)}) {
            trees_.push_back(build_bvh(mesh, {.builder = Builder::sbvh, .max_leaf = 1}));
            scenes_.emplace_back(mesh);
            lists_.push_back({{nullptr, {}, {}, 0}});
        }
        for (std::size_t i = 0; i < 2; ++i) lists_[i][0].bvh = &trees_[i];
        const auto anywhere = [&] { return random_transform(random, {0, 0, 0}, 3); };
        for (std::size_t i = 0; i < 4; ++i) place_in(inner_, i % 2, anywhere(), 1u << (i % 4));
        finish(inner_);
        for (std::size_t i = 0; i < 4; ++i)
            place_in(middle_, i % 2 ? 2 : i / 2, anywhere(), i == 3 ? 6u : ~0u);
        finish(middle_);
        for (std::size_t i = 0; i < count; ++i)
            place_in(top_,
                     i % 6 == 0   ? 3
                     : i % 6 == 1 ? 2
                                  : random.below(2),
                     random_transform(random, place, reach, i % 3 ? 1.0 : flat), i % 9 ? ~0u : 2u);
        finish(top_);
    }

    [[nodiscard]] const SceneD& scene() const { return scenes_.back(); }
    [[nodiscard]] const std::vector<Shown>& all() const { return lists_.back(); }

private:
    struct Group {
        SceneD scene;
        std::vector<Shown> list;
        std::uint32_t paths = 0;
    };
    void place_in(Group& group, std::size_t what, const TransformD& map, std::uint32_t mask) {
        group.scene.add(scenes_[what], map, {.mask = mask, .id = {}});
        const std::uint32_t number = ++group.paths;
        for (Shown shown : lists_[what]) {
            shown.inverses.insert(shown.inverses.begin(), *inverse_of(affine_of(map)));
            shown.masks.insert(shown.masks.begin(), mask);
            shown.number += number;
            group.list.push_back(std::move(shown));
        }
        group.paths += paths_[what];
    }
    void finish(Group& group) {
        group.scene.commit();
        scenes_.push_back(std::move(group.scene));
        lists_.push_back(std::move(group.list));
        paths_.push_back(group.paths);
    }

    std::deque<BvhD> trees_;
    std::vector<SceneD> scenes_;  // the two meshes, then inner, middle and top
    std::vector<std::vector<Shown>> lists_;
    std::vector<std::uint32_t> paths_{0, 0};
    Group inner_, middle_, top_;
};

std::vector<RayD> rays_around(Vec3d place, double reach, std::size_t count) {
    RandomD random(instance_edges_seed + 1);
    const auto near = [&](double r) { return place + r * random.direction(); };
    std::vector<RayD> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3d from = near(i % 4 == 0 ? 1000 * reach : 2 * reach);
        RayD ray{from, 0, near(reach) - from};
        if (i % 5 == 0) ray.tmax = random.between(0.2, 1.0);
        if (i % 7 == 0) ray.tmin = random.between(0.0, 0.5);
        if (i % 11 == 0)
            ray.direction =
                std::ldexp(1.0, static_cast<int>(random.below(1201)) - 600) * ray.direction;
        if (i % 13 == 0) ray.direction.y = i % 2 ? 0.0 : -0.0;
        rays.push_back(ray);
    }
    return rays;
}

void expect_every_instance(const char* name, Vec3d place, double reach, double flat) {
    const Nest nest(place, reach, flat, sanitized ? 20 : 60);
    ASSERT_GT(nest.all().size(), sanitized ? 30u : 100u);
    const std::vector<RayD> rays = rays_around(place, reach, 180 + 60 * thorough);
    RandomD random(instance_edges_seed);
    std::vector<std::uint32_t> masks;
    std::vector<HitD> expected;
    std::size_t hits = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        masks.push_back(i % 3 == 0 ? ~0u : 1u << random.below(4));
        expected.push_back(look_at_all(nest.all(), rays[i], masks[i]));
        hits += expected[i].hit();
    }
    std::cout << name << ": " << rays.size() << " rays through " << nest.all().size()
              << " meshes on their paths, " << hits << " hits\n";
    EXPECT_GT(hits, rays.size() / 20);
    for (const int threads : {1, 2, 7}) {
        const std::vector<HitD> found =
            trace(nest.scene(), rays, {.masks = masks, .threads = threads});
        std::vector<std::uint8_t> occluded(rays.size());
        EXPECT_EQ(
            trace_any(nest.scene(), rays, occluded, {.masks = masks, .threads = threads}).hits,
            hits);
        std::size_t wrong = 0, wrong_any = 0;
        for (std::size_t i = 0; i < rays.size(); ++i) {
            wrong += !(found[i] == expected[i]);
            wrong_any += (occluded[i] != 0) != expected[i].hit();
        }
        EXPECT_EQ(wrong, 0u) << name;
        EXPECT_EQ(wrong_any, 0u) << name;
    }
}

TEST(InstanceEdges, FarPlaces) {
    expect_every_instance("at home", {0, 0, 0}, 5, 1.0);
    expect_every_instance("UTM", utm_place, 5, 1.0);
    expect_every_instance("far out", {-3e11, 7e11, 1e11}, 5, 1.0);
}

/// Rounding on the way in moves rays by as much as the map stretches it: boxes must have room.
TEST(InstanceEdges, NearlyFlatMaps) {
    for (const double flat : {1e-3, 1e-6, 1e-8, 1e-10})
        expect_every_instance("flat", utm_place, 5, flat);
}

MeshD unit_cube() {
    MeshD cube;
    for (int i = 0; i < 8; ++i)
        cube.vertices.push_back({double(i & 1), double(i >> 1 & 1), double(i >> 2)});
    cube.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                      {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    return cube;
}

/// Rays from far away at the corners of nearly flattened cubes, alone or in a scene within the
/// scene, where a box ends with the cube: rounding inside decides whether they hit, and the box
/// must not know better.
TEST(InstanceEdges, RaysFromFarAwayAtTheCornersOfBoxes) {
    RandomD random(instance_edges_seed);
    constexpr std::uint32_t half = 20;
    const BvhD tree = build_bvh(unit_cube());
    const SceneD cube(unit_cube());
    SceneD group, scene;
    std::vector<TransformD> alone, grouped;
    for (std::uint32_t i = 0; i < half; ++i) {
        grouped.push_back(random_transform(random, {0, 0, 0}, 20));
        group.add(cube, grouped.back());
        alone.push_back(random_transform(random, {0, 0, 0}, 20, 1e-6));
        scene.add(cube, alone.back());
    }
    group.commit();
    const TransformD of_group = random_transform(random, {0, 0, 0}, 20);
    scene.add(group, of_group);
    scene.commit();
    const auto inverse = [](const TransformD& map) { return *inverse_of(affine_of(map)); };
    std::vector<Shown> all;
    for (std::uint32_t i = 0; i < half; ++i)
        all.push_back({&tree, {inverse(alone[i])}, {~0u}, 1 + i});
    for (std::uint32_t i = 0; i < half; ++i)
        all.push_back({&tree, {inverse(of_group), inverse(grouped[i])}, {~0u, ~0u}, half + 2 + i});
    const auto out = [](const TransformD& map, Vec3d p) {
        const AffineD a = affine_of(map);
        (a.vector(Double3(p)) + a.move).round_to(p);
        return p;
    };
    std::size_t hits = 0, wrong = 0;
    const std::size_t count = 500 * thorough;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3d corner = unit_cube().vertices[random.below(8)];
        const std::size_t k = random.below(half);
        const Vec3d at =
            random.below(2) == 0 ? out(alone[k], corner) : out(of_group, out(grouped[k], corner));
        const double far = std::ldexp(1.0, static_cast<int>(random.below(40)));
        const Vec3d from = at + far * random.direction();
        const RayD ray{from, 0, at - from};
        const HitD expected = look_at_all(all, ray, ~0u);
        hits += expected.hit();
        wrong += !(closest_hit(scene, ray) == expected);
    }
    std::cout << count << " rays, " << hits << " hits\n";
    EXPECT_EQ(wrong, 0u);
    EXPECT_GT(hits, count / 10);
    EXPECT_LT(hits, count);
}

/// A mesh at a UTM place, and the same at home placed there: what float cannot tell apart.
TEST(InstanceEdges, StandForTheMeshTheyMake) {
    // Corners in steps of 2^-12, so that they move to the place without rounding.
    Mesh ball = ball_mesh({0, 0, 0});
    for (Vec3& v : ball.vertices) {
        const auto snap = [](float x) { return std::round(x * 0x1p12f) * 0x1p-12f; };
        v = {snap(v.x), snap(v.y), snap(v.z)};
    }
    const SceneD home(in_double(ball));
    MeshD flat;
    SceneD scene;
    for (int i = 0; i < 27; ++i) {
        const Vec3d by =
            utm_place + Vec3d{double(i % 3) * 256, double(i / 3 % 3) * 256, double(i / 9) * 256};
        const double mirror = i % 2 ? -1.0 : 1.0;
        scene.add(home, {{{{mirror, 0, 0, by.x}, {0, 1, 0, by.y}, {0, 0, 1, by.z}}}});
        const auto first = static_cast<std::uint32_t>(flat.vertices.size());
        for (const Vec3 p : ball.vertices)
            flat.vertices.push_back(Vec3d{mirror * p.x, p.y, p.z} + by);
        for (const Triangle& t : ball.triangles)
            flat.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    }
    scene.commit();
    const BvhD whole = build_bvh(flat);
    std::size_t hits = 0;
    double worst = 0;
    for (const RayD& ray : rays_around(utm_place, 400, 100 * thorough)) {
        const HitD expected = closest_hit(whole, ray);
        const HitD found = closest_hit(scene, ray);
        ASSERT_EQ(found.hit(), expected.hit());
        if (!expected.hit()) continue;
        ++hits;
        EXPECT_NEAR(found.t / expected.t, 1.0, 1e-11);
        worst = std::max(worst, std::fabs(found.t / expected.t - 1.0));
        EXPECT_EQ(found.prim, expected.prim % ball.triangles.size());
    }
    std::cout << hits << " hits, t off by up to " << worst << "\n";
    EXPECT_GT(hits, 20u);
    const AabbD box = box_of_mesh(flat), bounds = scene.bounds();
    EXPECT_TRUE(min_of(box.lo, bounds.lo) == bounds.lo && max_of(box.hi, bounds.hi) == bounds.hi);
    EXPECT_LT(bounds.hi.x - box.hi.x, 1e-6);
}

/// Inverses in rational arithmetic, of maps that are nearly flat and of any size.
TEST(InstanceEdges, InversesAreRightToTheLastDigits) {
    RandomD random(instance_edges_seed);
    double worst = 0;
    for (std::size_t i = 0; i < 100 * thorough; ++i) {
        TransformD t = random_transform(random, utm_place, 10,
                                        std::ldexp(1.0, -static_cast<int>(random.below(36))));
        const double size = std::ldexp(1.0, static_cast<int>(random.below(801)) - 400);
        for (auto& row : t.m)
            for (std::size_t k = 0; k < 3; ++k) row[k] *= size;
        const std::optional<InverseD> inverse = inverse_of(affine_of(t));
        ASSERT_TRUE(inverse) << i;
        const auto exact_row = [&](std::size_t k) {
            return exact({t.m[k][0], t.m[k][1], t.m[k][2]});
        };
        const ExactPoint a = exact_row(0), b = exact_row(1), c = exact_row(2);
        const ExactPoint bc = cross(b, c), ca = cross(c, a), ab = cross(a, b);
        const Exact det = dot(a, bc);
        const auto check_row = [&](Double3 row, const Exact& x, const Exact& y, const Exact& z) {
            const auto off = [&](double found, const Exact& wanted) {
                if (wanted == 0) return found == 0.0 ? 0.0 : inf;
                return std::fabs(static_cast<double>(Exact(found) * det / wanted - 1));
            };
            worst = std::max({worst, off(row.x, x), off(row.y, y), off(row.z, z)});
        };
        check_row(inverse->rows.x, bc.x, ca.x, ab.x);
        check_row(inverse->rows.y, bc.y, ca.y, ab.y);
        check_row(inverse->rows.z, bc.z, ca.z, ab.z);
    }
    std::cout << "entries off by up to " << worst / 0x1p-53 << " roundings\n";
    EXPECT_LE(worst, 4 * 0x1p-53);
}

/// The point that a ray has at t inside, mapped back without rounding, is within what the box of
/// the instance allows: this is what culling rests on.
TEST(InstanceEdges, BoxesHoldWhatRoundingMoves) {
    RandomD random(instance_edges_seed);
    for (std::size_t i = 0; i < 100 * thorough; ++i) {
        const double flat = std::ldexp(1.0, -static_cast<int>(random.below(36)));
        const AffineD a = affine_of(random_transform(random, utm_place, 10, flat));
        const InverseD inverse = *inverse_of(a);
        const Vec3d corner{random.between(-5, 5), 1e3 * random.unit(), random.between(-1e-3, 0)};
        const ExtentD inner{{corner, corner + Vec3d{random.unit(), 0.0, 1.0}}, 0x1p-48};
        ImageD image(inner);
        image.go_through(a, inverse);
        const ExtentD outer = image.extent(inner);
        const Vec3d p = random.in(inner.box);  // the point that is hit
        const Vec3d from =
            utm_place + std::ldexp(1.0, static_cast<int>(random.below(20))) * random.direction();
        const double t = random.between(0.1, 2.0);
        // A ray whose point at t is p, but for rounding: what it is off by inside is `miss`.
        const auto map_row = [&](Double3 row, double move) {
            return Exact(row.x) * Exact(p.x) + Exact(row.y) * Exact(p.y) +
                   Exact(row.z) * Exact(p.z) + Exact(move);
        };
        const ExactPoint target{map_row(a.x, a.move.x), map_row(a.y, a.move.y),
                                map_row(a.z, a.move.z)};
        const auto toward = [&](const Exact& to, double start) {
            return static_cast<double>((to - Exact(start)) / Exact(t));
        };
        const RayD ray{
            from,
            0,
            {toward(target.x, from.x), toward(target.y, from.y), toward(target.z, from.z)}};
        const RayD inside = LineD(ray).into(inverse).ray(0, inf);
        const auto at = [&](double o, double d) { return Exact(o) + Exact(t) * Exact(d); };
        const ExactPoint there{at(inside.origin.x, inside.direction.x),
                               at(inside.origin.y, inside.direction.y),
                               at(inside.origin.z, inside.direction.z)};
        // If the point inside were on the mesh, the ray outside must be let in.
        const auto beyond = [](const Exact& x, double lo, double hi) {
            return x < Exact(lo) ? Exact(lo) - x : x > Exact(hi) ? x - Exact(hi) : Exact(0);
        };
        const Exact miss_inside = std::max({beyond(there.x, inner.box.lo.x, inner.box.hi.x),
                                            beyond(there.y, inner.box.lo.y, inner.box.hi.y),
                                            beyond(there.z, inner.box.lo.z, inner.box.hi.z)});
        const Exact miss_outside =
            std::max({beyond(at(from.x, ray.direction.x), outer.box.lo.x, outer.box.hi.x),
                      beyond(at(from.y, ray.direction.y), outer.box.lo.y, outer.box.hi.y),
                      beyond(at(from.z, ray.direction.z), outer.box.lo.z, outer.box.hi.z)});
        const Vec3d far = max_of(max_of(outer.box.hi - from, from - outer.box.lo),
                                 max_of(from - outer.box.hi, outer.box.lo - from));
        const Exact room = Exact(outer.error) * Exact(max_of(max_of(far.x, far.y), far.z));
        const Exact norm(a.norm());
        ASSERT_LE(miss_outside, room + norm * miss_inside) << "case " << i;
    }
}

/// Two hundred instances that all move: the same as a scene made for their new places.
TEST(InstanceEdges, ManyThatMove) {
    const SceneD ball(in_double(ball_mesh({0, 0, 0})));
    RandomD random(instance_edges_seed);
    SceneD scene, made_new;
    const auto anywhere = [&] { return random_transform(random, utm_place, 1e3); };
    for (int i = 0; i < 200; ++i) scene.add(ball, anywhere());
    scene.commit({.usage = Usage::moving, .threads = 1});
    for (std::uint32_t i = 0; i < 200; ++i) {
        const TransformD moved = anywhere();
        scene.set_transform(i, moved);
        made_new.add(ball, moved);
    }
    scene.commit({.usage = Usage::moving, .threads = 3});
    made_new.commit({.threads = 1});
    const std::vector<RayD> rays = rays_around(utm_place, 1e3, 100 * thorough);
    EXPECT_EQ(trace(scene, rays), trace(made_new, rays));
}

Transform turned_any_way(test::Random& random, float reach) {
    for (;;) {
        Transform t;
        for (auto& row : t.m)
            for (std::size_t k = 0; k < 4; ++k)
                row[k] = random.between(-1, 1) * (k == 3 ? reach : 1.0f);
        if (inverse_of(affine_of(t))) return t;
    }
}

/// A direction of few bits that is shorter by a power of two, and has no more bits as a float, hits
/// what it did, later by that power.
TEST(InstanceEdges, SubnormalDirectionsKeepTheirWay) {
    test::Random random(instance_edges_seed);
    const Scene soup(scaled(random_soup(300, 7), 1e-7f));
    Scene scene;
    for (int i = 0; i < 8; ++i) scene.add(soup, turned_any_way(random, 1e-7f));
    scene.commit();
    std::size_t hits = 0;
    for (int i = 0; i < 8000; ++i) {
        const auto whole = [&] { return static_cast<float>(random.below(15)) - 7.0f; };
        const auto near = [&] { return random.between(-1e-7f, 1e-7f); };
        const Vec3 d{whole(), whole(), whole()}, from{near(), near(), near()};
        if (d == Vec3{0, 0, 0}) continue;
        const Hit wanted = closest_hit(scene, {from, 0, d}),
                  found = closest_hit(scene, {from, 0, 0x1p-146f * d});
        ASSERT_EQ(found.hit(), wanted.hit());
        if (!wanted.hit()) continue;
        ++hits;
        ASSERT_EQ(found.t, wanted.t * 0x1p73f * 0x1p73f);
        ASSERT_EQ(found.prim, wanted.prim);
        ASSERT_EQ(found.u, wanted.u);
        ASSERT_EQ(found.instance, wanted.instance);
    }
    EXPECT_GT(hits, 100u);
}

/// Places that differ, at t that are all less than any float: the first instance wins.
TEST(InstanceEdges, TiesOfLongDirections) {
    const Scene wall(
        Mesh{"", {{-1e-9f, -1e-9f, 0}, {1e-9f, -1e-9f, 0}, {0, 1e-9f, 0}}, {{0, 1, 2}}});
    Scene scene;
    for (int i = 0; i < 16; ++i) {
        Transform moved;
        moved.m[2][3] = static_cast<float>(16 - i) * 1e-9f;
        scene.add(wall, moved);
    }
    scene.commit();
    for (const Vec3 d : {Vec3{0, 0, 1e38f}, Vec3{1e35f, 1e36f, 1e38f}}) {
        const Hit hit = closest_hit(scene, {{0, -5e-10f, 0}, 0, d});
        ASSERT_TRUE(hit.hit());
        EXPECT_EQ(hit.t, 0.0f);
        EXPECT_EQ(hit.instance, 1u);
    }
}

/// Rays that start on a triangle, from both sides and in instances that are turned over.
/// A triangle a little behind the end of a long ray has the t of the end in the caller's units.
TEST(InstanceEdges, TiesOfLongDirectionsEndWithTheRay) {
    const auto check = [](auto& scene, const auto& mesh, auto ray, auto little) {
        using Scene = std::remove_reference_t<decltype(scene)>;
        using Map = std::conditional_t<std::is_same_v<Scene, raydix::Scene>, Transform, TransformD>;
        Map behind;
        behind.m[2][3] = little;
        scene.add(Scene(mesh), behind);
        scene.add(Scene(mesh), Map{});
        scene.commit();
        ray.tmin = ray.tmax = 0;
        EXPECT_EQ(closest_hit(scene, ray).instance, 2u);
        for (const auto& hit : trace(scene, std::vector(100, ray))) EXPECT_EQ(hit.instance, 2u);
    };
    Scene floats;
    const Mesh mesh{"", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    check(floats, mesh, Ray{{0.25f, 0.25f, 0}, 0, {0, 0, 0x1p122f}}, 0x1p-52f);
    SceneD doubles;
    const MeshD wide{"", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    check(doubles, wide, RayD{{0.25, 0.25, 0}, 0, {0, 0, 0x1p1000}}, 0x1p-200);
}

TEST(InstanceEdges, NoTIsMinusZero) {
    const Scene triangle(Mesh{"", {{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}}, {{0, 1, 2}}});
    std::size_t hits = 0;
    for (const float side : {1.0f, -1.0f}) {
        Scene scene;
        scene.add(triangle, {{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, side, 0}}}});
        scene.commit();
        for (const float tmin : {0.0f, -0.0f})
            for (const Vec3 d : {Vec3{0, 0, 1}, Vec3{0, 0, -1}, Vec3{0.5f, 0.25f, -1}}) {
                const Hit hit = closest_hit(scene, {{0, -0.5f, 0}, tmin, d});
                if (!hit.hit()) continue;
                ++hits;
                EXPECT_FALSE(std::signbit(hit.t));
            }
    }
    EXPECT_EQ(hits, 12u);
}

}  // namespace
}  // namespace raydix::test
