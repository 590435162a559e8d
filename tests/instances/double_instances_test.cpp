// Instances in double against every instance on its own, against exact arithmetic, and at places
// where float has steps of half a metre.
#include <gtest/gtest.h>
#include <raydix/double.h>
#include <raydix/error.h>
#include <raydix/instances_d.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>

#include "instances/affine_double.h"
#include "support/double_scenes.h"
#include "support/message.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t seed = 20151102;
constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr std::uint32_t top = InstancedSceneD::scene;

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

TransformD moved_to(Vec3d place) {
    return {{{{1, 0, 0, place.x}, {0, 1, 0, place.y}, {0, 0, 1, place.z}}}};
}

/// Ways from a scene to one tree.
struct Shown {
    const BvhD* bvh;
    std::uint32_t object;
    std::vector<InverseD> inverses;  // from the scene inward
    std::vector<std::uint32_t> masks;
    std::array<std::uint32_t, InstanceHitD::max_levels> path;
};

InstanceHitD look_at_all(const std::vector<Shown>& all, const RayD& ray, std::uint32_t mask) {
    InstanceHitD best;
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
        if (!best.hit.hit() || hit.t < best.hit.t ||
            (hit.t == best.hit.t && shown.path < best.path))
            best = {hit, shown.object, shown.path};
    }
    return best;
}

/// A scene with two groups in it, one within the other, and the same as a list.
class Nest {
public:
    Nest(Vec3d place, double reach, double flat, std::size_t count)
        : soup_(build_bvh(random_soup_d(200, 1, 0.5), {.builder = Builder::sbvh, .max_leaf = 1})),
          ball_(build_bvh(in_double(ball_mesh({0, 0, 0}), 0.01))),
          floats_(build_bvh(random_soup(200, 3), {.builder = Builder::sbvh})),
          of_floats_(build_bvh(in_double(random_soup(200, 3)))) {
        RandomD random(seed);
        const std::uint32_t soup = scene.add_object(soup_), ball = scene.add_object(ball_),
                            empty = scene.add_object(none_), floats = scene.add_object(floats_);
        trees_ = {nullptr, &soup_, &ball_, &none_, &of_floats_};
        const std::uint32_t inner = scene.add_group(), middle = scene.add_group();
        const std::uint32_t meshes[] = {soup, ball, floats, empty};
        const auto mesh = [&](std::size_t i) { return meshes[i % 4]; };
        const auto anywhere = [&] { return random_transform(random, {0, 0, 0}, 3, 1.0); };
        for (std::size_t i = 0; i < 5; ++i)
            scene.add_instance(inner, {mesh(i), anywhere(), std::uint32_t{1} << (i % 4)});
        for (std::size_t i = 0; i < 4; ++i)
            scene.add_instance(middle, {i % 2 ? inner : mesh(i), anywhere(), i == 3 ? 6u : ~0u});
        for (std::size_t i = 0; i < count; ++i)
            scene.add_instance(top, {i % 6 == 0   ? middle
                                     : i % 6 == 1 ? inner
                                                  : mesh(random.below(4)),
                                     random_transform(random, place, reach, i % 3 ? 1.0 : flat),
                                     i % 9 ? ~0u : 2u});
        scene.build();
        show(top, {nullptr, 0, {}, {}, InstanceHit::unused()});
    }

    InstancedSceneD scene;
    std::vector<Shown> all;

private:
    void show(std::uint32_t group, const Shown& so_far) {
        for (std::uint32_t i = 0; i < scene.instance_count(group); ++i) {
            const InstanceD& instance = scene.instance(group, i);
            Shown next = so_far;
            next.path[so_far.inverses.size()] = i;
            next.inverses.push_back(*inverse_of(affine_of(instance.transform)));
            next.masks.push_back(instance.mask);
            next.object = instance.object;
            if (instance.object >= trees_.size()) {
                show(instance.object, next);
            } else {
                next.bvh = trees_[instance.object];
                all.push_back(next);
            }
        }
    }

    BvhD soup_, ball_, none_;
    Bvh floats_;
    BvhD of_floats_;
    std::vector<const BvhD*> trees_;  // by object; 0 is the scene
};

std::vector<RayD> rays_around(Vec3d place, double reach, std::size_t count) {
    RandomD random(seed + 1);
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
    const Nest nest(place, reach, flat, 60);
    ASSERT_GT(nest.all.size(), 100u);
    const std::vector<RayD> rays = rays_around(place, reach, 180 + 60 * thorough);
    RandomD random(seed);
    std::vector<std::uint32_t> masks;
    std::vector<InstanceHitD> expected;
    std::size_t hits = 0, nested = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        masks.push_back(i % 3 == 0 ? ~0u : 1u << random.below(4));
        expected.push_back(look_at_all(nest.all, rays[i], masks[i]));
        hits += expected[i].hit.hit();
        nested += expected[i].path[2] != no_primitive;
    }
    std::cout << name << ": " << rays.size() << " rays through " << nest.all.size()
              << " instances, " << hits << " hits, " << nested << " on the third level\n";
    EXPECT_GT(hits, rays.size() / 20);
    EXPECT_GT(nested, 0u);
    for (const int threads : {1, 2, 7}) {
        const std::vector<InstanceHitD> found =
            trace(nest.scene, rays, {.masks = masks, .threads = threads});
        std::vector<std::uint8_t> occluded(rays.size());
        const InstanceTraceCounts counts =
            trace_any(nest.scene, rays, occluded, {.masks = masks, .threads = threads});
        EXPECT_EQ(counts.hits, hits);
        std::size_t wrong = 0, wrong_any = 0;
        for (std::size_t i = 0; i < rays.size(); ++i) {
            wrong += !(found[i] == expected[i]);
            wrong_any += (occluded[i] != 0) != expected[i].hit.hit();
        }
        EXPECT_EQ(wrong, 0u) << name;
        EXPECT_EQ(wrong_any, 0u) << name;
    }
    EXPECT_EQ(closest_hit(nest.scene, rays[1], masks[1]), expected[1]);
}

TEST(DoubleInstances, AreEveryInstanceOnItsOwn) {
    expect_every_instance("at home", {0, 0, 0}, 5, 1.0);
    expect_every_instance("UTM", utm_place, 5, 1.0);
    expect_every_instance("far out", {-3e11, 7e11, 1e11}, 5, 1.0);
}

/// Rounding on the way in moves rays by as much as the map stretches it: boxes must have room.
TEST(DoubleInstances, NearlyFlatMapsToo) {
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

/// Cubes that stand in the scene, nearly flattened, and others in a group, which is its last
/// instance; the same as a list.
class Cubes {
public:
    static constexpr std::uint32_t half = 20;

    explicit Cubes(RandomD& random) : cube_(build_bvh(unit_cube())) {
        const std::uint32_t object = scene.add_object(cube_);
        group_ = scene.add_group();
        const auto transform = [&](double flat) {
            return random_transform(random, {0, 0, 0}, 20, flat);
        };
        for (std::uint32_t i = 0; i < half; ++i) {
            scene.add_instance(group_, {object, transform(1.0)});
            scene.add_instance(top, {object, transform(1e-6)});
        }
        scene.add_instance(top, {group_, transform(1.0)});
        scene.build();
        for (std::uint32_t i = 0; i < half; ++i) {
            show(object, {inverse(top, i)}, {i});
            show(object, {inverse(top, half), inverse(group_, i)}, {half, i});
        }
    }
    /// A place of a random cube, in the scene.
    [[nodiscard]] Vec3d outside(RandomD& random, Vec3d p) const {
        const auto i = static_cast<std::uint32_t>(random.below(half));
        if (random.below(2) == 0) return out(top, i, p);
        return out(top, half, out(group_, i, p));
    }

    InstancedSceneD scene;
    std::vector<Shown> all;

private:
    [[nodiscard]] AffineD map(std::uint32_t group, std::uint32_t i) const {
        return affine_of(scene.instance(group, i).transform);
    }
    [[nodiscard]] InverseD inverse(std::uint32_t group, std::uint32_t i) const {
        return *inverse_of(map(group, i));
    }
    [[nodiscard]] Vec3d out(std::uint32_t group, std::uint32_t i, Vec3d p) const {
        Vec3d q;
        (map(group, i).vector(Double3(p)) + map(group, i).move).round_to(q);
        return q;
    }
    void show(std::uint32_t object, const std::vector<InverseD>& inverses,
              const std::vector<std::uint32_t>& path) {
        all.push_back(
            {&cube_, object, inverses, std::vector(path.size(), ~0u), InstanceHit::unused()});
        std::copy(path.begin(), path.end(), all.back().path.begin());
    }

    BvhD cube_;
    std::uint32_t group_;
};

/// Rays from far away at the corners of cubes, where a box ends with the cube: rounding inside
/// decides whether they hit, and the box must not know better.
TEST(DoubleInstances, RaysFromFarAwayAtTheCornersOfBoxes) {
    RandomD random(seed);
    const Cubes cubes(random);
    std::size_t hits = 0, wrong = 0;
    const std::size_t count = 500 * thorough;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3d at = cubes.outside(random, unit_cube().vertices[random.below(8)]);
        const double far = std::ldexp(1.0, static_cast<int>(random.below(40)));
        const Vec3d from = at + far * random.direction();
        const RayD ray{from, 0, at - from};
        const InstanceHitD expected = look_at_all(cubes.all, ray, ~0u);
        hits += expected.hit.hit();
        wrong += !(closest_hit(cubes.scene, ray) == expected);
    }
    std::cout << count << " rays, " << hits << " hits\n";
    EXPECT_EQ(wrong, 0u);
    EXPECT_GT(hits, count / 10);
    EXPECT_LT(hits, count);
}

/// A mesh at a UTM place, and the same at home placed there: what float cannot tell apart.
TEST(DoubleInstances, StandForTheMeshTheyMake) {
    // Corners in steps of 2^-12, so that they move to the place without rounding.
    Mesh ball = ball_mesh({0, 0, 0});
    for (Vec3& v : ball.vertices) {
        const auto snap = [](float x) { return std::round(x * 0x1p12f) * 0x1p-12f; };
        v = {snap(v.x), snap(v.y), snap(v.z)};
    }
    const BvhD home = build_bvh(in_double(ball));
    MeshD flat;
    InstancedSceneD scene;
    const std::uint32_t object = scene.add_object(home);
    for (int i = 0; i < 27; ++i) {
        const Vec3d by =
            utm_place + Vec3d{double(i % 3) * 256, double(i / 3 % 3) * 256, double(i / 9) * 256};
        const double mirror = i % 2 ? -1.0 : 1.0;
        scene.add_instance(top,
                           {object, {{{{mirror, 0, 0, by.x}, {0, 1, 0, by.y}, {0, 0, 1, by.z}}}}});
        const auto first = static_cast<std::uint32_t>(flat.vertices.size());
        for (const Vec3 p : ball.vertices)
            flat.vertices.push_back(Vec3d{mirror * p.x, p.y, p.z} + by);
        for (const Triangle& t : ball.triangles)
            flat.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    }
    scene.build();
    const BvhD whole = build_bvh(flat);
    std::size_t hits = 0;
    double worst = 0;
    for (const RayD& ray : rays_around(utm_place, 400, 100 * thorough)) {
        const HitD expected = closest_hit(whole, ray);
        const InstanceHitD found = closest_hit(scene, ray);
        ASSERT_EQ(found.hit.hit(), expected.hit());
        if (!expected.hit()) continue;
        ++hits;
        EXPECT_NEAR(found.hit.t / expected.t, 1.0, 1e-11);
        worst = std::max(worst, std::fabs(found.hit.t / expected.t - 1.0));
        EXPECT_EQ(found.hit.prim, expected.prim % ball.triangles.size());
    }
    std::cout << hits << " hits, t off by up to " << worst << "\n";
    EXPECT_GT(hits, 20u);
    const AabbD box = box_of_mesh(flat), bounds = scene.bounds();
    EXPECT_TRUE(min_of(box.lo, bounds.lo) == bounds.lo && max_of(box.hi, bounds.hi) == bounds.hi);
    EXPECT_LT(bounds.hi.x - box.hi.x, 1e-6);
}

/// Inverses in rational arithmetic, of maps that are nearly flat and of any size.
TEST(DoubleInstances, InversesAreRightToTheLastDigits) {
    RandomD random(seed);
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
TEST(DoubleInstances, BoxesHoldWhatRoundingMoves) {
    RandomD random(seed);
    for (std::size_t i = 0; i < 100 * thorough; ++i) {
        const double flat = std::ldexp(1.0, -static_cast<int>(random.below(36)));
        const AffineD a = affine_of(random_transform(random, utm_place, 10, flat));
        const InverseD inverse = *inverse_of(a);
        const Vec3d corner{random.between(-5, 5), 1e3 * random.unit(), random.between(-1e-3, 0)};
        const ExtentD inner{{corner, corner + Vec3d{random.unit(), 0.0, 1.0}}, 0x1p-48};
        const ExtentD outer = image_of(a, inverse, inner);
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

TEST(DoubleInstances, MoveAndAreBuiltAgain) {
    const BvhD ball = build_bvh(in_double(ball_mesh({0, 0, 0})));
    InstancedSceneD scene;
    const std::uint32_t object = scene.add_object(ball);
    scene.add_instance(top, {object, moved_to(utm_place)});
    const RayD ray{utm_place + Vec3d{0, 0, 1000}, 0, {0, 0, -1}};
    EXPECT_THROW(static_cast<void>(closest_hit(scene, ray)), InputError) << "not built";
    scene.build();
    const double before = closest_hit(scene, ray).hit.t;
    EXPECT_NEAR(before, 900, 1);
    scene.set_instance(top, 0, {object, moved_to(utm_place + Vec3d{0, 0, 500})});
    EXPECT_THROW(static_cast<void>(closest_hit(scene, ray)), InputError)
        << "changed after the build";
    scene.build();
    EXPECT_EQ(closest_hit(scene, ray).hit.t, before - 500);
    EXPECT_EQ(scene.instance(top, 0).transform.m[2][3], 750.0);
    EXPECT_EQ(scene.instance_count(), 1u);
    // Two hundred instances that all move: the same as a scene made for their new places.
    InstancedSceneD made_new;
    made_new.add_object(ball);
    RandomD random(seed);
    for (int i = 0; i < 200; ++i)
        scene.add_instance(top, {object, random_transform(random, utm_place, 1e3)});
    scene.build(1);
    made_new.add_instance(top, scene.instance(top, 0));
    for (std::uint32_t i = 1; i <= 200; ++i) {
        const InstanceD moved{object, random_transform(random, utm_place, 1e3)};
        scene.set_instance(top, i, moved);
        made_new.add_instance(top, moved);
    }
    scene.build(3);
    made_new.build(1);
    const std::vector<RayD> rays = rays_around(utm_place, 1e3, 100 * thorough);
    EXPECT_EQ(trace(scene, rays), trace(made_new, rays));
}

/// At one place the lower path wins, then the lower triangle.
TEST(DoubleInstances, TiesGoToTheLowerPath) {
    const BvhD ball = build_bvh(in_double(ball_mesh({0, 0, 0})));
    InstancedSceneD scene;
    const std::uint32_t object = scene.add_object(ball), group = scene.add_group();
    scene.add_instance(group, {object, moved_to({0, 0, 0}), 4});
    scene.add_instance(group, {object});
    for (int i = 0; i < 3; ++i) scene.add_instance(top, {group, moved_to(utm_place)});
    scene.add_instance(top, {object, moved_to(utm_place)});
    scene.build();
    const RayD ray{utm_place + Vec3d{3, 1, 1000}, 0, {0, 0, -1}};
    const InstanceHitD hit = closest_hit(scene, ray);
    EXPECT_EQ(hit.path[0], 0u);
    EXPECT_EQ(hit.path[1], 0u);
    EXPECT_EQ(hit.object, object);
    EXPECT_EQ(closest_hit(scene, ray, 2).path[1], 1u) << "what its mask hides is passed over";
    EXPECT_EQ(closest_hit(scene, ray, 2).hit, hit.hit);
    EXPECT_FALSE(closest_hit(scene, ray, 0).hit.hit());
}

TEST(DoubleInstances, RefuseWhatCannotBe) {
    const BvhD ball = build_bvh(in_double(ball_mesh({0, 0, 0})));
    InstancedSceneD scene;
    const std::uint32_t object = scene.add_object(ball), group = scene.add_group();
    scene.add_instance(top, {object});
    const auto with = [&](std::array<std::array<double, 4>, 3> m) {
        return message_of([&] { scene.add_instance(top, {object, {m}}); });
    };
    const std::string singular =
        "instance 1: its transform is singular or not finite, so rays cannot go through it";
    EXPECT_EQ(with({{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 0, 0}}}), singular);
    EXPECT_EQ(with({{{0, 0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0, 0}}}), singular);
    EXPECT_EQ(with({{{1, 2, 3, 0}, {2, 4, 6, 0}, {0, 0, 1, 0}}}), singular);
    EXPECT_EQ(with({{{0.1, 0.2, 0.3, 0}, {0.7, 0.1, 0.9, 0}, {0.8, 0.3, 1.2, 0}}}), singular)
        << "dependent but for rounding";
    EXPECT_EQ(with({{{nan, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}}), singular);
    EXPECT_EQ(with({{{1, 0, 0, inf}, {0, 1, 0, 0}, {0, 0, 1, 0}}}), singular);
    EXPECT_EQ(with({{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1e-310, 0}}}), singular)
        << "its inverse is beyond doubles";
    EXPECT_EQ(message_of([&] { scene.add_instance(group, {77}); }),
              "instance 0 of group 2: there is no object 77");
    EXPECT_EQ(message_of([&] { scene.add_instance(object, {object}); }), "object 1 is no group");
    EXPECT_EQ(message_of([&] { scene.set_instance(group, 3, {object}); }),
              "there is no instance 3 of group 2");
    EXPECT_EQ(message_of([&] { static_cast<void>(scene.instance(top, 1)); }),
              "there is no instance 1");
    EXPECT_EQ(scene.instance_count(), 1u);
    // Tiny, but not flat.
    EXPECT_EQ(with({{{1e-6, 0, 0, 0}, {0, 1e-6, 0, 0}, {0, 0, -1e-6, 0}}}), "no error");
    scene.build();
    // Out of range when placed.
    EXPECT_EQ(with({{{1, 0, 0, 1e13}, {0, 1, 0, 0}, {0, 0, 1, 0}}}), "no error");
    EXPECT_EQ(message_of([&] { scene.build(); }),
              "instance 2: it reaches beyond 1e12, or is not finite");
    scene.set_instance(top, 2,
                       {object, {{{{1e300, 0, 0, 0}, {0, 1e300, 0, 0}, {0, 0, 1e300, 0}}}}});
    EXPECT_EQ(message_of([&] { scene.build(); }),
              "instance 2: it reaches beyond 1e12, or is not finite");
    scene.set_instance(top, 2, {object});
    scene.build();
    const std::vector<Vec3> points{{0, 0, 0}};
    const Bvh of_points = build_bvh(points);
    EXPECT_THROW(scene.add_object(of_points), InputError);
}

TEST(DoubleInstances, CirclesAndDeepNestsAreErrors) {
    const BvhD ball = build_bvh(in_double(ball_mesh({0, 0, 0})));
    InstancedSceneD scene;
    const std::uint32_t object = scene.add_object(ball), a = scene.add_group(),
                        b = scene.add_group();
    scene.add_instance(top, {a});
    scene.add_instance(a, {b});
    scene.add_instance(b, {a});
    EXPECT_EQ(message_of([&] { scene.build(); }),
              "group 2 shows itself, directly or through others");
    scene.set_instance(b, 0, {top});
    EXPECT_EQ(message_of([&] { scene.build(); }),
              "group 0 shows itself, directly or through others");
    scene.set_instance(b, 0, {object});
    scene.build();
    const RayD ray{{0, 0, 1000}, 0, {0, 0, -1}};
    EXPECT_EQ(closest_hit(scene, ray).path[2], 0u);
    for (const std::size_t levels :
         {InstanceHitD::max_levels, InstanceHitD::max_levels + 1, std::size_t{5000}}) {
        InstancedSceneD deep;
        const std::uint32_t leaf = deep.add_object(ball);
        std::uint32_t last = top;
        for (std::size_t k = 1; k < levels; ++k) {
            const std::uint32_t next = deep.add_group();
            deep.add_instance(last, {next});
            last = next;
        }
        deep.add_instance(last, {leaf});
        if (levels > InstanceHitD::max_levels) {
            EXPECT_THROW(deep.build(), InputError);
        } else {
            deep.build();
            EXPECT_TRUE(closest_hit(deep, ray).hit.hit());
        }
    }
}

TEST(DoubleInstances, NothingAndBadRays) {
    InstancedSceneD scene;
    scene.build();
    const RayD ray{{0, 0, 1000}, 0, {0, 0, -1}};
    EXPECT_FALSE(closest_hit(scene, ray).hit.hit());
    EXPECT_GT(scene.bounds().lo.x, scene.bounds().hi.x);
    const BvhD none;
    const std::uint32_t object = scene.add_object(none), group = scene.add_group();
    scene.add_instance(top, {object, moved_to({1e300, 0, 0})});
    scene.add_instance(top, {group});
    scene.build();
    EXPECT_FALSE(closest_hit(scene, ray).hit.hit());
    EXPECT_GT(scene.bounds().lo.x, scene.bounds().hi.x);
    const std::vector<RayD> bad{{{nan, 0, 0}, 0, {0, 0, 1}}, {{0, 0, 0}, 0, {0, 0, 0}}};
    std::vector<InstanceHitD> hits(2);
    EXPECT_EQ(trace(scene, bad, hits).invalid_rays, 2u);
    EXPECT_THROW(trace(scene, bad, std::span(hits).first(1)), InputError);
    const std::vector<std::uint32_t> masks{1};
    EXPECT_THROW(trace(scene, bad, hits, {.masks = masks}), InputError);
}

}  // namespace
}  // namespace raydix::test
