// Pictures and secondary rays of spheres, capsules, points and user geometry, which have no
// triangles: what they look like follows from normals that are known by formulas.
#include <gtest/gtest.h>
#include <raydix/double.h>
#include <raydix/picture.h>
#include <raydix/rays.h>
#include <raydix/scene.h>
#include <raydix/shapes.h>
#include <raydix/trace.h>
#include <raydix/user_geometry.h>

#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "base/double3.h"
#include "build/shapes.h"
#include "image/pictures.h"
#include "support/message.h"

namespace raydix::test {
namespace {

/// Looks from the front, and a little from above.
template <class T>
BasicCamera<T> camera_before_shapes() {
    return {"before shapes", {T(0.5), T(1), T(6)}, {0, 0, 0}, {0, 1, 0}, 40};
}

/// A unit ball that an instance stretches to twice its width and moves by `move`: so
/// (x - move)^2 / 4 + y^2 + z^2 = 1.
template <class T>
struct Egg {
    static constexpr double move = 0.25;
    BasicScene<T> ball, scene;

    Egg() {
        const std::vector<BasicSphere<T>> spheres{{{0, 0, 0}, 1}};
        ball.add(spheres);
        ball.commit();
        BasicTransform<T> map;
        map.m = {{{2, 0, 0, T(move)}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
        scene.add(ball, map, {.id = 3});
        scene.commit();
    }
    /// At a point of its surface, outward.
    static Double3 normal(Double3 p) { return normalized(Double3((p.x - move) / 4, p.y, p.z)); }
};

template <class T>
class RenderShapes : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(RenderShapes, Scalars);

TYPED_TEST(RenderShapes, NormalsAreThoseOfTheSurface) {
    using T = TypeParam;
    const Egg<T> egg;
    const auto camera = camera_before_shapes<T>();
    const RenderOptions options = options_for(View::normal);
    const Picture picture = render(egg.scene, camera, options);
    std::vector<std::uint32_t> pixels;
    const auto rays = make_primary_rays(camera, options.width, options.height, &pixels);
    const auto hits = trace(egg.scene, rays);
    std::size_t seen = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!hits[i].hit()) continue;
        const Double3 direction(rays[i].direction);
        const Double3 normal = Egg<T>::normal(Double3(rays[i].origin) + direction * hits[i].t);
        if (dot(normal, direction) > -0.1) continue;  // at its rim a hit's place is coarse
        const Vec3 colour = picture.pixels[pixels[i]];
        EXPECT_NEAR(colour.x, 0.5 + 0.5 * normal.x, 1e-4);
        EXPECT_NEAR(colour.y, 0.5 + 0.5 * normal.y, 1e-4);
        EXPECT_NEAR(colour.z, 0.5 + 0.5 * normal.z, 1e-4);
        ++seen;
    }
    EXPECT_GT(seen, 300u);
}

/// Views that gather light are those of a mesh of many small triangles.
TYPED_TEST(RenderShapes, LightIsThatOfAFineMesh) {
    using T = TypeParam;
    Mesh fine;
    add_sphere(fine, {0, 0, 0}, 1, 160);
    BasicMesh<T> mesh;
    for (const Vec3& p : fine.vertices)
        mesh.vertices.push_back({T(Egg<T>::move + 2.0 * p.x), T(p.y), T(p.z)});
    mesh.triangles = fine.triangles;
    const BasicScene<T> of_triangles(mesh);
    const Egg<T> egg;
    for (const View view : {View::shaded, View::ao, View::diffuse, View::path}) {
        const RenderOptions options = options_for(view);
        const Picture wanted = render(of_triangles, camera_before_shapes<T>(), options),
                      found = render(egg.scene, camera_before_shapes<T>(), options);
        double sum = 0;
        for (std::size_t i = 0; i < found.pixels.size(); ++i)
            sum += std::abs(double{found.pixels[i].x} - double{wanted.pixels[i].x});
        EXPECT_LT(sum / static_cast<double>(found.pixels.size()), 0.005) << view_name(view);
    }
}

TYPED_TEST(RenderShapes, CapsulesPointsAndEmptyBallsAreDrawn) {
    using T = TypeParam;
    const std::vector<BasicCapsule<T>> capsules{{{-1, 0, 0}, {1, 0, 0}, T(0.5)}};
    const std::vector<BasicVec3<T>> points{{0, T(1.5), 0}};
    const std::vector<BasicSphere<T>> none{{{0, -1, 0}, 0}};
    BasicScene<T> scene;
    scene.add(capsules);
    scene.add(std::span<const BasicVec3<T>>(points), T(0.3));
    scene.add(none);
    scene.commit();
    BasicCamera<T> camera;
    camera.position = {0, 0, 9};
    camera.target = {0, 0, 0};
    const RenderOptions options = options_for(View::normal, 65, 65);
    const Picture picture = render(scene, camera, options);
    for (const Vec3& p : picture.pixels)
        EXPECT_TRUE(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
    // In its middle the axis of the capsule is level: nothing points to a side.
    std::size_t up = 0;
    for (std::size_t row = 0; row < 65; ++row) {
        const Vec3 p = picture.pixels[row * 65 + 32];
        if (p.z == 0.0f) continue;
        EXPECT_NEAR(p.x, 0.5, 1e-4);
        up += p.y > 0.7f;
    }
    EXPECT_GT(up, 1u);
}

/// A ball that only its function knows.
template <class T>
BasicUserGeometry<T> user_ball(std::span<const BasicAabb<T>> box) {
    return BasicUserGeometry<T>(box, [](std::uint32_t, const BasicRay<T>& ray, BasicHit<T>& hit) {
        const Double3 o(ray.origin), d(ray.direction);
        const double a = dot(d, d), b = dot(o, d), root = b * b - a * (dot(o, o) - 1.0);
        if (!(root > 0.0)) return false;
        const T t = static_cast<T>((-b - std::sqrt(root)) / a);
        if (!(t >= ray.tmin && t <= ray.tmax)) return false;
        hit.t = t;
        return true;
    });
}

TYPED_TEST(RenderShapes, UserGeometryFacesTheRay) {
    using T = TypeParam;
    const std::vector<BasicAabb<T>> box{{{-1, -1, -1}, {1, 1, 1}}};
    BasicScene<T> scene;
    scene.add(user_ball<T>(box));
    scene.commit();
    const auto camera = camera_before_shapes<T>();
    const RenderOptions options = options_for(View::normal);
    const Picture picture = render(scene, camera, options);
    std::vector<std::uint32_t> pixels;
    const auto rays = make_primary_rays(camera, options.width, options.height, &pixels);
    const auto hits = trace(scene, rays);
    std::size_t seen = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!hits[i].hit()) continue;
        EXPECT_NEAR(picture.pixels[pixels[i]].x, 0.5 - 0.5 * double(rays[i].direction.x), 1e-6);
        ++seen;
    }
    EXPECT_GT(seen, 100u);
}

TYPED_TEST(RenderShapes, SecondaryRaysLeaveThem) {
    using T = TypeParam;
    const Egg<T> egg;
    std::vector<std::uint32_t> pixels;
    const auto rays = make_primary_rays(camera_before_shapes<T>(), 32, 24, &pixels);
    const auto hits = trace(egg.scene, rays);
    constexpr int samples = 4;
    const auto secondary =
        make_secondary_rays(egg.scene, rays, hits, pixels,
                            {.kind = RayKind::diffuse, .samples = samples, .sorted = false});
    std::size_t next = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!hits[i].hit()) continue;
        const Double3 point = Double3(rays[i].origin) + Double3(rays[i].direction) * hits[i].t;
        for (int k = 0; k < samples; ++k, ++next) {
            ASSERT_LT(next, secondary.size());
            EXPECT_GT(dot(Double3(secondary[next].direction), Egg<T>::normal(point)), -1e-3);
            EXPECT_LT(length(Double3(secondary[next].origin) - point), 1e-4);
        }
    }
    EXPECT_EQ(next, secondary.size());
    EXPECT_GT(next, 300u);
}

TYPED_TEST(RenderShapes, SecondaryRaysRefuseUserGeometry) {
    using T = TypeParam;
    const std::vector<BasicAabb<T>> box{{{-1, -1, -1}, {1, 1, 1}}};
    BasicScene<T> inner, outer;
    inner.add(user_ball<T>(box));
    inner.commit();
    outer.add(inner, BasicTransform<T>{});
    outer.commit();
    const std::vector<BasicRay<T>> rays{{{0, 0, 5}, 0, {0, 0, -1}}};
    const std::vector<std::uint32_t> pixels{0};
    const auto message = [&](const BasicScene<T>& scene) {
        return message_of(
            [&] { (void)make_secondary_rays(scene, rays, trace(scene, rays), pixels, {}); });
    };
    EXPECT_EQ(message(inner),
              "make_secondary_rays: hit 0: geometry 0 (user geometry) has no normals: only its "
              "owner knows them");
    EXPECT_EQ(
        message(outer),
        "make_secondary_rays: hit 0: geometry 0 (user geometry) on path 1 of instances has no "
        "normals: only its owner knows them");
}

}  // namespace
}  // namespace raydix::test
