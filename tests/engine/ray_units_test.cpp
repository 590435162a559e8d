// Directions are brought near unit length by powers of two: batches and single calls agree where an
// instance takes a direction to the limit of that, and the start of a ray stays where it is.
#include <gtest/gtest.h>
#include <raydix/double.h>
#include <raydix/scene.h>
#include <raydix/trace.h>

#include <cmath>
#include <limits>
#include <vector>

#include "support/random.h"

namespace raydix {
namespace {

template <class Scalar>
class RayUnits : public testing::Test {};
using BothScalars = testing::Types<float, double>;
TYPED_TEST_SUITE(RayUnits, BothScalars);

/// A square of half the side `big` at height 0, and a sphere over it.
template <class Scalar>
BasicScene<Scalar> square_and_sphere(Scalar big) {
    BasicMesh<Scalar> square;
    square.vertices = {{-big, -big, 0}, {big, -big, 0}, {big, big, 0}, {-big, big, 0}};
    square.triangles = {{0, 1, 2}, {0, 2, 3}};
    BasicScene<Scalar> scene;
    scene.add(square);
    scene.add(std::vector<BasicSphere<Scalar>>{{{0, 0, 2 * big}, big / 2}});
    scene.commit();
    return scene;
}

/// By `scale`, and a quarter turn `turns` times about an axis, as cos and sin give it: directions
/// come out a little shorter or longer than a power of two.
template <class Scalar>
BasicTransform<Scalar> turned(Scalar scale, unsigned turns, unsigned axis) {
    const Scalar angle = Scalar(3.14159265358979323846) / 2 * Scalar(turns);
    const Scalar c = scale * std::cos(angle), s = scale * std::sin(angle);
    const unsigned p = (axis + 1) % 3, q = (axis + 2) % 3;
    BasicTransform<Scalar> t;
    for (auto& row : t.m)
        for (Scalar& x : row) x = 0;
    t.m[axis][axis] = scale;
    t.m[p][p] = t.m[q][q] = c;
    t.m[p][q] = s, t.m[q][p] = -s;
    return t;
}

template <class Scalar>
std::vector<BasicRay<Scalar>> rays_from(test::Random& random, unsigned axis, Scalar length) {
    std::vector<BasicRay<Scalar>> rays(100);
    for (BasicRay<Scalar>& ray : rays) {
        Scalar origin[3], direction[3];
        for (unsigned a = 0; a < 3; ++a) {
            origin[a] = Scalar(int(random.below(33)) - 16) / 14;
            direction[a] = Scalar(int(random.below(33)) - 16) / 300;
        }
        origin[axis] = 10, direction[axis] = -length;
        ray.origin = {origin[0], origin[1], origin[2]};
        ray.direction = {direction[0], direction[1], direction[2]};
    }
    return rays;
}

TYPED_TEST(RayUnits, BatchesThroughInstancesAnswerAsSingleCalls) {
    using Scalar = TypeParam;
    test::Random random(20261127);
    std::size_t hits = 0;
    for (unsigned k = 0; k < 96; ++k) {
        const Scalar big = std::ldexp(Scalar(1), int(random.below(12)) - 6);
        Scalar scale = 1 / big;
        if (k % 3 == 1) scale = std::nextafter(scale, Scalar(99));
        if (k % 3 == 2) scale = std::nextafter(scale, Scalar(0));
        const BasicScene<Scalar> inner = square_and_sphere(big);
        BasicScene<Scalar> scene, nested;
        scene.add(inner, turned(scale, unsigned(random.below(4)), unsigned(random.below(3))));
        scene.commit();
        nested.add(scene, {});
        nested.commit();
        const auto rays = rays_from(random, unsigned(random.below(3)),
                                    std::ldexp(Scalar(1), int(random.below(3))));
        for (const BasicScene<Scalar>* shown : {&scene, &nested}) {
            std::vector<BasicHit<Scalar>> alone;
            for (const BasicRay<Scalar>& ray : rays) {
                alone.push_back(closest_hit(*shown, ray));
                hits += alone.back().hit() ? 1 : 0;
            }
            for (const SimdPath path : {SimdPath::automatic, SimdPath::packet, SimdPath::stream,
                                        SimdPath::sorted, SimdPath::single}) {
                const auto found = trace(*shown, rays, {.path = path});
                for (std::size_t i = 0; i < rays.size(); ++i)
                    ASSERT_EQ(found[i], alone[i])
                        << "case " << k << ", ray " << i << ", path " << int(path);
            }
        }
    }
    EXPECT_GT(hits, 3000u);
}

/// One past 0 leaves out a hit at 0, however short the direction.
TYPED_TEST(RayUnits, ATminAboveZeroLeavesOutAHitAtZero) {
    using Scalar = TypeParam;
    using Limits = std::numeric_limits<Scalar>;
    BasicMesh<Scalar> mesh;
    mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.triangles = {{0, 1, 2}};
    const BasicScene<Scalar> scene(mesh);
    BasicScene<Scalar> placed, shape;
    placed.add(scene, turned(Scalar(4), 0, 0));
    placed.commit();
    shape.add(std::vector<BasicSphere<Scalar>>{{{Scalar(0.25), Scalar(0.25), 1}, 1}});
    shape.commit();
    for (const Scalar length : {Scalar(1), Scalar(0.1), Scalar(1e-3), Scalar(1e-20), Scalar(1e3)})
        for (const Scalar tmin : {Limits::denorm_min(), Limits::min() / 4, Limits::min()}) {
            BasicRay<Scalar> ray;
            ray.origin = {Scalar(0.25), Scalar(0.25), 0};
            ray.direction = {0, 0, length};
            ray.tmin = tmin;
            const std::vector<BasicRay<Scalar>> rays(40, ray);
            for (const BasicScene<Scalar>* shown :
                 {&scene, static_cast<const BasicScene<Scalar>*>(&placed)}) {
                EXPECT_FALSE(closest_hit(*shown, ray).hit()) << length << " " << tmin;
                EXPECT_FALSE(any_hit(*shown, ray));
                EXPECT_FALSE(trace(*shown, rays)[39].hit());
                EXPECT_TRUE(trace_all(*shown, rays).hits.empty());
                ray.tmin = 0;
                EXPECT_EQ(closest_hit(*shown, ray).t, 0);
                ray.tmin = tmin;
            }
            EXPECT_NE(closest_hit(shape, ray).t, 0) << length << " " << tmin;
        }
}

}  // namespace
}  // namespace raydix
