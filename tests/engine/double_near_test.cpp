// Distance and overlap on scenes in double: against a look at every triangle as it is in the world,
// and against trees over a mesh that another walk makes.
#include <gtest/gtest.h>
#include <raydix/double.h>
#include <raydix/error.h>
#include <raydix/result_limit.h>
#include <raydix/scene_pairs.h>
#include <raydix/scene_queries.h>
#include <raydix/solid.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "engine/double_world.h"
#include "engine/near_shapes.h"
#include "primitives/exact_overlap.h"
#include "proximity/closest_walk.h"
#include "proximity/touch_walk.h"
#include "support/message.h"
#include "support/sanitized.h"

namespace raydix::test {
namespace {

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();

struct FlatWorldD {
    MeshD mesh;
    std::vector<ScenePrimitive> names;  // [triangles]
    std::vector<bool> turned;           // second and third corner have changed places
    struct Shape {
        ScenePrimitive name;
        CapsuleD own;
        std::vector<TransformD> way;  // the outermost first
    };
    std::vector<Shape> shapes;
};

bool mirrors(const TransformD& t) {
    const AffineD map = affine_of(t);
    return dot(map.x, cross(map.y, map.z)) < 0;
}

Vec3d out_of(const std::vector<TransformD>& way, Vec3d p) {
    for (auto t = way.rbegin(); t != way.rend(); ++t) {
        const auto row = [&](std::size_t r) {
            return ((p.x * t->m[r][0] + p.y * t->m[r][1]) + p.z * t->m[r][2]) + t->m[r][3];
        };
        p = {row(0), row(1), row(2)};
    }
    return {p.x + 0.0, p.y + 0.0, p.z + 0.0};
}

void add_flat(const WorldD& world, std::uint32_t mask, std::uint32_t number,
              std::vector<TransformD>& way, FlatWorldD& out) {
    bool turned = false;
    for (const TransformD& t : way) turned ^= mirrors(t);
    for (const WorldD::Item& item : world.items) {
        if (item.inside || (item.mask & mask) == 0) continue;
        for (std::uint32_t i = 0; i < item.capsules.size(); ++i)
            out.shapes.push_back({{number, item.id, i}, item.capsules[i], way});
        const auto first = static_cast<std::uint32_t>(out.mesh.vertices.size());
        for (const Vec3d p : item.mesh.vertices) out.mesh.vertices.push_back(out_of(way, p));
        for (std::uint32_t i = 0; i < item.mesh.triangles.size(); ++i) {
            Triangle t = item.mesh.triangles[i];
            if (turned) std::swap(t[1], t[2]);
            out.mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
            out.names.push_back({number, item.id, i});
            out.turned.push_back(turned);
        }
    }
    std::uint32_t next = number + 1;
    for (const WorldD::Item& item : world.items) {
        if (!item.inside) continue;
        way.push_back(item.transform);
        if ((item.mask & mask) != 0) add_flat(*item.inside, mask, next, way, out);
        way.pop_back();
        next += 1 + static_cast<std::uint32_t>(item.inside->paths());
    }
}

FlatWorldD flat_of(const WorldD& world, std::uint32_t mask) {
    FlatWorldD out;
    std::vector<TransformD> way;
    add_flat(world, mask, 0, way, out);
    return out;
}

LeafTriangleD triangle_of(const FlatWorldD& flat, std::size_t i) {
    const Triangle& t = flat.mesh.triangles[i];
    return {flat.mesh.vertices[t[0]], flat.mesh.vertices[t[1]], flat.mesh.vertices[t[2]]};
}

/// A ball's or a capsule's image.
ShapePointD closest_on(const FlatWorldD::Shape& shape, Vec3d q) {
    const CapsuleD& own = shape.own;
    if (shape.way.empty()) return closest_on_capsule(Double3(own.a), Double3(own.b), own.radius, q);
    Affine all{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {}};
    for (auto t = shape.way.rbegin(); t != shape.way.rend(); ++t) {
        const AffineD map = affine_of(*t);
        const auto row = [&](Double3 r) { return all.x * r.x + all.y * r.y + all.z * r.z; };
        all = {row(map.x), row(map.y), row(map.z), {}};
    }
    return closest_on_image(Double3(out_of(shape.way, own.a)), Double3(out_of(shape.way, own.b)),
                            BallImage(all, own.radius), own.radius, q);
}
bool touches(const FlatWorldD::Shape& shape, const SphereD& s) {
    return closest_on(shape, s.center).d2 <= s.radius * s.radius;
}
bool touches(const FlatWorldD::Shape& shape, const SegmentD& s) {
    const auto inside = [&](Vec3d p) {
        Double3 at(p);
        for (const TransformD& t : shape.way) at = inverse_of(affine_of(t))->point(at);
        return at - Double3(shape.own.a);
    };
    const Double3 axis = Double3(shape.own.b) - Double3(shape.own.a);
    return segment_distance2(inside(s.a), inside(s.b), {}, axis) <=
           shape.own.radius * shape.own.radius;
}

auto answer_of(const SceneClosestPointD& p) {
    return std::tuple(p.distance, p.position.x, p.position.y, p.position.z,
                      ScenePrimitive{p.instance, p.geometry, p.prim}, p.u, p.v);
}
auto answer_of(const SceneSweepHitD& h) {
    return std::tuple(h.t, ScenePrimitive{h.instance, h.geometry, h.prim}, h.position.x,
                      h.position.y, h.position.z, h.u, h.v);
}

SceneClosestPointD brute_closest(const FlatWorldD& flat, Vec3d q, double max_distance) {
    SceneClosestPointD best;
    if (!is_finite(q)) return best;
    double d2 = max_distance * max_distance;
    ScenePrimitive least{no_primitive, no_primitive, no_primitive};
    for (std::size_t i = 0; i < flat.names.size(); ++i) {
        const auto p = closest_on_triangle(triangle_of(flat, i), q);
        if (!(p.d2 < d2 || (p.d2 == d2 && flat.names[i] < least))) continue;
        d2 = p.d2, least = flat.names[i];
        best = {p.position, std::sqrt(p.d2), least.prim, least.geometry, least.instance, p.u, p.v};
        if (flat.turned[i]) std::swap(best.u, best.v);
    }
    for (const FlatWorldD::Shape& shape : flat.shapes) {
        const ShapePointD p = closest_on(shape, q);
        if (!(p.d2 < d2 || (p.d2 == d2 && shape.name < least))) continue;
        d2 = p.d2, least = shape.name;
        best = {p.position, std::sqrt(p.d2), least.prim, least.geometry, least.instance, p.u, 0};
    }
    return best;
}

bool touches(const LeafTriangleD& t, const SphereD& s) {
    return closest_on_triangle(t, s.center).d2 <= s.radius * s.radius;
}
bool touches(const LeafTriangleD& t, const SegmentD& s) {
    const SegmentD exact = prepared(s);
    return segment_touches_triangle(exact.a, exact.b, t);
}

/// On corners, edges and faces, beside them, far away, and nowhere.
std::vector<Vec3d> queries_of(RandomWorlds& random, const FlatWorldD& flat, Vec3d home,
                              std::size_t count) {
    std::vector<Vec3d> queries;
    for (std::size_t i = 0; i < count; ++i) {
        Vec3d q = random.around(home, i % 7 == 0 ? 1e4 : 3);
        if (!flat.names.empty() && i % 3 == 0) {
            const LeafTriangleD t = triangle_of(flat, random.below(flat.names.size()));
            q = i % 2 == 0 ? t.v1 : 0.5 * t.v0 + 0.5 * t.v1;
            if (i % 9 == 0) q = 0.25 * t.v0 + 0.25 * t.v1 + 0.5 * t.v2;
        }
        if (i % 61 == 0) q.y = nan_value;
        if (i % 67 == 0) q = {1e200, -1e180, 3e150};
        if (i % 71 == 0) q.z = infinity;
        queries.push_back(q);
    }
    return queries;
}

std::size_t wrong_points(const WorldD& world, const FlatWorldD& flat, std::uint32_t mask,
                         const std::vector<Vec3d>& queries) {
    std::size_t wrong = 0;
    for (const double most : {std::numeric_limits<double>::infinity(), 0.25, 0.0}) {
        std::vector<SceneClosestPointD> expected;
        for (const Vec3d& q : queries) expected.push_back(brute_closest(flat, q, most));
        for (const int threads : {1, 2}) {
            std::vector<SceneClosestPointD> found(queries.size());
            const QueryCounts counts =
                closest_points(world.scene, queries, found,
                               {.max_distance = most, .mask = mask, .threads = threads});
            std::uint64_t found_count = 0, invalid = 0;
            for (std::size_t i = 0; i < queries.size(); ++i) {
                const SceneClosestPointD& wanted = expected[i];
                wrong += answer_of(found[i]) != answer_of(wanted);
                found_count += wanted.found();
                invalid += !is_finite(queries[i]);
                if (i % 5 == 0)
                    wrong += answer_of(closest_point(world.scene, queries[i], most, mask)) !=
                             answer_of(wanted);
            }
            wrong += counts.found != found_count || counts.invalid_queries != invalid;
        }
    }
    return wrong;
}

template <class Query>
std::size_t wrong_touches(const WorldD& world, const FlatWorldD& flat, std::uint32_t mask,
                          const std::vector<Query>& queries, std::size_t& touched_count) {
    std::size_t wrong = 0;
    const SceneOverlapOptions options{.mask = mask, .threads = 2};
    const std::span<const Query> all(queries);
    std::vector<std::uint8_t> touched(queries.size(), 7);
    touch_any(world.scene, all, touched, options);
    const SceneOverlapLists lists = touch_all(world.scene, all, options);
    for (std::size_t i = 0; i < queries.size(); ++i) {
        std::vector<ScenePrimitive> wanted;
        for (std::size_t k = 0; is_valid(queries[i]) && k < flat.names.size(); ++k)
            if (touches(triangle_of(flat, k), queries[i])) wanted.push_back(flat.names[k]);
        for (std::size_t k = 0; is_valid(queries[i]) && k < flat.shapes.size(); ++k)
            if (touches(flat.shapes[k], queries[i])) wanted.push_back(flat.shapes[k].name);
        std::ranges::sort(wanted);
        const std::vector<ScenePrimitive> found(
            lists.prims.begin() + static_cast<std::ptrdiff_t>(lists.offsets[i]),
            lists.prims.begin() + static_cast<std::ptrdiff_t>(lists.offsets[i + 1]));
        wrong += found != wanted;
        wrong += touched[i] != (wanted.empty() ? 0 : 1);
        if (i % 8 == 0) wrong += raydix::touches(world.scene, queries[i], mask) != !wanted.empty();
        touched_count += wanted.size();
    }
    return wrong;
}

std::size_t wrong_sweeps(const WorldD& world, const FlatWorldD& flat, std::uint32_t mask,
                         const std::vector<SphereSweepD>& sweeps, std::size_t& hit_count) {
    const BvhD tree = build_bvh(flat.mesh, {.builder = Builder::binned});
    const std::vector<SweepHitD> expected = sweep_spheres(tree, sweeps);
    const std::vector<SceneSweepHitD> found =
        sweep_spheres(world.scene, sweeps, {.mask = mask, .threads = 2});
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < sweeps.size(); ++i) {
        SceneSweepHitD wanted;
        if (const SweepHitD& hit = expected[i]; hit.hit()) {
            const ScenePrimitive& name = flat.names[hit.prim];
            wanted = {hit.t, name.prim, name.geometry, name.instance, hit.position, hit.u, hit.v};
            if (flat.turned[hit.prim]) std::swap(wanted.u, wanted.v);
        }
        wrong += answer_of(found[i]) != answer_of(wanted);
        hit_count += wanted.hit();
        if (i % 7 == 0)
            wrong += answer_of(sweep_sphere(world.scene, sweeps[i], mask)) != answer_of(wanted);
    }
    return wrong;
}

TEST(DoubleNear, WorldsAnswerAsTheirTrianglesDo) {
    std::size_t touched = 0, swept = 0, shapes = 0;
    for (std::uint32_t levels = 0; levels < 4; ++levels)
        for (int k = 0; k < 6; k += sanitized ? 3 : 1) {
            SCOPED_TRACE("levels " + std::to_string(levels) + ", world " + std::to_string(k));
            RandomWorlds random(9000 + 100 * levels + static_cast<std::uint64_t>(k));
            const double shears[] = {1e4, 100.0, 0.0}, distances[] = {0.0, 4.5e6, 1e11};
            RecipeD recipe{levels, 1 + random.under(levels == 3 ? 4 : 6), shears[k % 3],
                           distances[k % 3]};
            recipe.shapes = k >= 3, recipe.users = false;
            const auto world = random.world(recipe);
            for (const std::uint32_t mask : {every_mask, 2u, 5u}) {
                if (sanitized && mask == 5) continue;
                const FlatWorldD flat = flat_of(*world, mask);
                const std::vector<Vec3d> queries = queries_of(
                    random, flat, world->home, recipe.shapes ? fewer(30, 5) : fewer(150, 10));
                EXPECT_EQ(wrong_points(*world, flat, mask, queries), 0u);
                std::vector<SphereD> spheres;
                std::vector<SegmentD> segments;
                std::vector<SphereSweepD> sweeps;
                for (std::size_t i = 0; i + 1 < queries.size(); ++i) {
                    const Vec3d a = queries[i], b = queries[i + 1];
                    spheres.push_back({a, i % 4 == 0 ? 0.0 : random.between(0, 0.6)});
                    segments.push_back({a, i % 5 == 0 ? a : b});
                    sweeps.push_back({{a, i % 6 == 0 ? 0.25 : 0.0, b - a}, 0.0});
                    if (i % 3 != 0) sweeps.back().radius = random.between(0.01, 0.5);
                    if (i % 4 == 0) sweeps.back().path.tmax = 1.0;
                }
                spheres.push_back({{0, 0, 0}, -1});
                EXPECT_EQ(wrong_touches(*world, flat, mask, spheres, touched), 0u);
                EXPECT_EQ(wrong_touches(*world, flat, mask, segments, touched), 0u);
                if (flat.shapes.empty())
                    EXPECT_EQ(wrong_sweeps(*world, flat, mask, sweeps, swept), 0u);
                else
                    EXPECT_THROW(
                        static_cast<void>(sweep_spheres(world->scene, sweeps, {.mask = mask})),
                        InputError);
                shapes += flat.shapes.size();
            }
        }
    EXPECT_GT(touched, fewer(1000, 10));
    EXPECT_GT(swept, fewer(200, 10));
    EXPECT_GT(shapes, fewer(200, 10));
}

TEST(DoubleNear, OneMeshAnswersAsItsTreeDoes) {
    RandomWorlds random(77);
    const MeshD mesh = random_soup_d(3000, 5, 0.05);
    const SceneD scene(mesh);
    const BvhD tree = build_bvh(mesh);
    std::vector<Vec3d> queries;
    for (int i = 0; i < 5000; ++i) queries.push_back(random.around({0, 0, 0}, 1.5));
    const std::vector<ClosestPointD> wanted = closest_points(tree, queries);
    const std::vector<SceneClosestPointD> found = closest_points(scene, queries);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < queries.size(); ++i)
        wrong += answer_of(found[i]) !=
                 answer_of(SceneClosestPointD{wanted[i].position, wanted[i].distance,
                                              wanted[i].prim, 0, 0, wanted[i].u, wanted[i].v});
    EXPECT_EQ(wrong, 0u);
}

TEST(DoubleNear, FarPlacesCostNoDigits) {
    SceneD inner(one_triangle()), scene;
    scene.add(inner, moved(1e11, -1e11, 5e10));
    scene.commit();
    const SceneClosestPointD p = closest_point(scene, {1e11 + 0.25, -1e11 + 0.25, 5e10 + 0.5});
    EXPECT_EQ(p.distance, 0.5);
    EXPECT_EQ(p.instance, 1u);
    EXPECT_EQ(p.u, 0.25);
    const SceneSweepHitD hit =
        sweep_sphere(scene, {{{1e11 + 0.25, -1e11 + 0.25, 5e10 + 4}, 0, {0, 0, -1}}, 0.125});
    EXPECT_EQ(hit.t, 3.875);
}

TEST(DoubleNear, MirroredInstancesKeepTheirOwnCorners) {
    SceneD inner(one_triangle()), scene;
    TransformD mirror;
    mirror.m[0][0] = -1;
    scene.add(inner, mirror);
    scene.commit();
    const SceneClosestPointD p = closest_point(scene, {-0.5, 0.25, 3});
    EXPECT_EQ(p.u, 0.5);
    EXPECT_EQ(p.v, 0.25);
    const SceneSweepHitD hit = sweep_sphere(scene, {{{-0.5, 0.25, 3}, 0, {0, 0, -1}}, 0.5});
    EXPECT_EQ(hit.u, 0.5);
    EXPECT_EQ(hit.v, 0.25);
}

TEST(DoubleNear, TrianglesWithoutAreaAreFound) {
    MeshD mesh;
    mesh.vertices = {{0, 0, 0}, {2, 0, 0}, {1, 0, 0}, {5, 5, 5}};
    mesh.triangles = {{0, 1, 2}, {3, 3, 3}};
    SceneD inner(mesh), scene;
    scene.add(inner, moved(10, 0, 0));
    scene.commit();
    EXPECT_EQ(closest_point(scene, {11.5, 1, 0}).prim, 0u);
    EXPECT_EQ(closest_point(scene, {15, 5, 6}).prim, 1u);
    EXPECT_TRUE(raydix::touches(scene, SegmentD{{11, 1, 0}, {11, -1, 0}}));
    EXPECT_TRUE(raydix::touches(scene, SphereD{{15, 5, 6}, 1}));
}

TEST(DoubleNear, ChangesCountFromTheirCommitOn) {
    SceneD scene(one_triangle());
    const Vec3d query{0.25, 0.25, 2};
    EXPECT_EQ(closest_point(scene, query).distance, 2);
    scene.add(one_triangle(1));
    EXPECT_EQ(closest_point(scene, query).distance, 2) << "the last commit stands";
    scene.commit();
    EXPECT_EQ(closest_point(scene, query).distance, 1);
    EXPECT_EQ(closest_point(scene, query).geometry, 1u);
    scene.set_mask(1, 4);
    scene.commit();
    for (int round = 0; round < 2; ++round)
        for (std::uint32_t bit = 0; bit < 32; ++bit)
            EXPECT_EQ(closest_point(scene, query, infinity, 1u << bit).distance, bit == 2 ? 1 : 2);
    EXPECT_FALSE(closest_point(scene, query, infinity, 0).found());
}

TEST(DoubleNear, ManyThreadsMayAskFirst) {
    RandomWorlds random(5);
    const MeshD mesh = random_soup_d(500, 5, 0.1);
    SceneD inner(mesh), scene;
    for (int k = 0; k < 6; ++k)
        scene.add(inner, random.transform({0, 0, 0}, {0, 0, 0}, 3, 0), {.mask = 1u << (k % 6)});
    scene.commit();
    std::vector<Vec3d> queries;
    for (int i = 0; i < 600; ++i) queries.push_back(random.around({0, 0, 0}, 4));
    std::vector<std::vector<SceneClosestPointD>> found(6);
    std::vector<std::thread> threads;
    for (std::uint32_t k = 0; k < 6; ++k)
        threads.emplace_back([&, k] {
            found[k] = closest_points(scene, queries, {.mask = k < 3 ? every_mask : 1u << k});
        });
    for (std::thread& thread : threads) thread.join();
    for (std::uint32_t k = 0; k < 6; ++k)
        for (std::size_t i = 0; i < queries.size(); ++i)
            EXPECT_EQ(answer_of(found[k][i]),
                      answer_of(closest_point(scene, queries[i], infinity,
                                              k < 3 ? every_mask : 1u << k)));
}

TEST(DoubleNear, ShapesAnswerWhatTheyAre) {
    const Vec3d home{4.5e6, -4.5e6, 120};
    const std::vector<SphereD> spheres{{home, 2}, {home, 0}};
    const std::vector<CapsuleD> capsules{{home + Vec3d{10, 0, 0}, home + Vec3d{14, 0, 0}, 1}};
    SceneD scene;
    scene.add(std::span<const SphereD>(spheres).first(1));
    scene.add(std::span<const CapsuleD>(capsules));
    scene.commit();
    SceneClosestPointD p = closest_point(scene, home + Vec3d{0, 5, 0});
    EXPECT_EQ(p.distance, 3);
    EXPECT_EQ(p.position.y, home.y + 2);
    EXPECT_EQ(closest_point(scene, home + Vec3d{1, 1, 0}).distance, 0) << "inside";
    p = closest_point(scene, home + Vec3d{13, 0, 4});
    EXPECT_EQ(p.distance, 3);
    EXPECT_EQ(p.u, 0.75);
    EXPECT_EQ(p.geometry, 1u);
    EXPECT_TRUE(raydix::touches(scene, SegmentD{home + Vec3d{9, 1, -9}, home + Vec3d{11, 1, 9}}));
    EXPECT_FALSE(
        raydix::touches(scene, SegmentD{home + Vec3d{9, 1.001, -9}, home + Vec3d{11, 1.001, 9}}));
    // A point, and an ellipsoid.
    SceneD inner, outer;
    inner.add(std::span<const SphereD>(spheres).last(1));
    inner.commit();
    TransformD wide;
    wide.m[0][0] = 3, wide.m[0][3] = -2 * home.x;
    outer.add(inner, wide);
    outer.add(scene, wide);
    outer.commit();
    EXPECT_EQ(closest_point(outer, home + Vec3d{7, 0, 0}).distance, 1) << "6 wide";
    EXPECT_EQ(closest_point(outer, home + Vec3d{0, 0, 7}).distance, 5);
    EXPECT_EQ(closest_point(outer, home).instance, 1u);
}

/// The square of a distance has no end, but the point is that of a place on the same line that is
/// near enough for squares.
TEST(DoubleNear, ShapesAreFoundFromTheEndOfAllDoubles) {
    const std::vector<SphereD> spheres{{{1, -2, 3}, 1e-3}};  // in its units queries end sooner
    const std::vector<CapsuleD> capsules{{{4, 0, 1}, {7, 1, -1}, 0.5}};
    TransformD wide;
    wide.m[0][0] = 3, wide.m[1][0] = 0.5;
    for (const bool capsule : {false, true}) {
        SceneD plain, image;
        if (capsule)
            plain.add(std::span<const CapsuleD>(capsules));
        else
            plain.add(std::span<const SphereD>(spheres));
        plain.commit();
        image.add(plain, wide);
        image.commit();
        for (const SceneD* const scene : {&plain, &image})
            for (const Vec3d& way : {Vec3d{1, 0.3, -1}, Vec3d{-0.4, 1, 0.2}, Vec3d{0, 0, -1}}) {
                const Vec3d near = closest_point(*scene, way * 0x1p100).position;
                for (const int exponent : {400, 500, 501, 515, 700, 1000, 1023}) {
                    const SceneClosestPointD p =
                        closest_point(*scene, way * std::ldexp(1.0, exponent));
                    ASSERT_EQ(p.geometry, 0u);
                    EXPECT_NEAR(p.position.x, near.x, 1e-12) << capsule << ' ' << exponent;
                    EXPECT_NEAR(p.position.y, near.y, 1e-12) << capsule << ' ' << exponent;
                    EXPECT_NEAR(p.position.z, near.z, 1e-12) << capsule << ' ' << exponent;
                }
            }
    }
}

TEST(DoubleNear, ErrorsNameTheGeometry) {
    const std::vector<SphereD> spheres{{{0, 0, 0}, 1}};
    const std::vector<AabbD> boxes{{{0, 0, 0}, {1, 1, 1}}};
    SceneD inner, scene;
    inner.add(std::span<const SphereD>(spheres), {.mask = 2, .id = 7});
    inner.add(UserGeometryD(boxes, [](std::uint32_t, const RayD&, HitD&) { return false; }),
              {.mask = 4, .id = 9});
    inner.commit();
    scene.add(one_triangle());
    scene.add(inner, moved(0, 0, 0));
    scene.commit();
    const std::string users =
        "closest points: geometry 9 (user geometry) on path 1 of instances has no distances: it is "
        "known by its hits alone";
    for (int round = 0; round < 2; ++round) {
        EXPECT_EQ(message_of([&] { static_cast<void>(closest_point(scene, {0, 0, 0})); }), users);
        EXPECT_TRUE(closest_point(scene, {0, 0, 5}, infinity, 3).found());
        EXPECT_EQ(message_of([&] {
                      static_cast<void>(sweep_sphere(scene, {down, 1}, 3));
                  }),
                  "sweeps: geometry 7 (spheres) on path 1 of instances cannot be swept against: "
                  "only triangles can");
        EXPECT_TRUE(sweep_sphere(scene, {down, 1}, 1).hit());
    }
    // All triangles as one body: shapes are none.
    EXPECT_THROW(SolidD(scene, {.mask = 3}), InputError);
    EXPECT_THROW(static_cast<void>(overlapping_pairs(scene, {.mask = 3})), InputError);
}

TEST(DoubleNear, NothingIsFoundInNothing) {
    SceneD scene;
    EXPECT_THROW(static_cast<void>(closest_point(scene, {0, 0, 0})), InputError);
    scene.commit();
    EXPECT_FALSE(closest_point(scene, {0, 0, 0}).found());
    EXPECT_FALSE(raydix::touches(scene, SphereD{{0, 0, 0}, 1e6}));
    EXPECT_FALSE(sweep_sphere(scene, {down, 1}).hit());
    SceneD inner;
    inner.commit();
    scene.add(inner, moved(1, 2, 3));
    scene.add(MeshD{});
    scene.commit();
    const std::vector<Vec3d> queries(3000, Vec3d{1, 2, 3});
    EXPECT_FALSE(closest_points(scene, queries)[2999].found());
    EXPECT_EQ(touch_all(scene, std::vector<SphereD>(10, {{0, 0, 0}, 1})).offsets.size(), 11u);
}

TEST(DoubleNear, CallsRefuseWhatScenesInFloatRefuse) {
    const SceneD scene(one_triangle());
    std::vector<Vec3d> queries(3);
    std::vector<SceneClosestPointD> room(2);
    EXPECT_THROW(closest_points(scene, queries, room), InputError);
    EXPECT_THROW(static_cast<void>(closest_points(scene, queries, {.max_distance = -1})),
                 InputError);
    EXPECT_THROW(static_cast<void>(closest_points(scene, queries, {.max_distance = nan_value})),
                 InputError);
    EXPECT_THROW(static_cast<void>(closest_points(scene, queries, {.isa = "abacus"})), InputError);
    EXPECT_THROW(static_cast<void>(closest_points(scene, queries, {.threads = -1})), InputError);
}

TEST(DoubleNear, ListsThatAreTooLargeAreRefused) {
    RandomWorlds random(3);
    SceneD scene(random_soup_d(200, 5, 0.5));
    const std::vector<SphereD> spheres(100, {{0, 0, 0}, 10});
    // The tree is too large, and later the lists.
    for (int round = 0; round < 2; ++round) {
        EXPECT_THROW(static_cast<void>(touch_all(scene, spheres, {.max_result_bytes = 20000})),
                     ResultTooLarge);
        EXPECT_EQ(touch_all(scene, spheres).prims.size(), 20000u);
    }
}

}  // namespace
}  // namespace raydix::test
