// What commits leave out: counted, and refused where they are strict.
#include <gtest/gtest.h>
#include <raydix/double.h>
#include <raydix/error.h>
#include <raydix/scene.h>
#include <raydix/shapes.h>
#include <raydix/user_geometry.h>

#include <limits>
#include <span>
#include <string>
#include <vector>

#include "support/message.h"

namespace raydix {
namespace {

template <class Scalar>
class LeftOut : public ::testing::Test {
protected:
    using Scene = BasicScene<Scalar>;
    using Mesh = typename Scene::Mesh;
    static constexpr Scalar nan = std::numeric_limits<Scalar>::quiet_NaN();

    /// Of them, those of odd numbers are invalid.
    static Mesh triangles(std::uint32_t count) {
        Mesh mesh;
        for (std::uint32_t k = 0; k < count; ++k) {
            const auto x = static_cast<Scalar>(k);
            mesh.vertices.insert(mesh.vertices.end(),
                                 {{x, 0, 0}, {x + 1, 0, k % 4 == 3 ? nan : Scalar(1)}, {x, 1, 0}});
            if (k % 4 == 1) mesh.vertices.back().y = Scalar(2e12);
            mesh.triangles.push_back({3 * k, 3 * k + 1, 3 * k + 2});
        }
        return mesh;
    }
    static std::string refusal(Scene& scene, SceneOptions options) {
        options.strict = true;
        return test::message_of([&] { scene.commit(options); });
    }
};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(LeftOut, Scalars);

TYPED_TEST(LeftOut, TrianglesAreCountedOrRefused) {
    for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high})
        for (const Usage usage : {Usage::fixed, Usage::moving}) {
            const SceneOptions options{.quality = quality, .usage = usage};
            typename TestFixture::Scene scene;
            scene.add(this->triangles(1));
            EXPECT_EQ(scene.commit(options).left_out, 0u);
            EXPECT_EQ(this->refusal(scene, options), "no error");
            scene.add(this->triangles(7), {.id = 5});
            scene.add(this->triangles(100), {.id = 9});
            // Nothing is asked of a scene whose commit was refused but what the last one saw.
            EXPECT_EQ(
                this->refusal(scene, options),
                "geometry 5: triangle 1: not finite, out of range or inverted, as are 2 others");
            EXPECT_FALSE(scene.committed());
            EXPECT_EQ(scene.bounds().hi.x, 1);
            EXPECT_EQ(scene.commit(options).left_out, 53u);
            EXPECT_EQ(scene.commit(options).left_out, 53u) << "trees that are kept count too";
            EXPECT_NE(this->refusal(scene, options), "no error") << "and are refused too";
            scene.remove(9);
            EXPECT_EQ(scene.commit(options).left_out, 3u);
        }
}

TYPED_TEST(LeftOut, MovedVertices) {
    const SceneOptions moving{.usage = Usage::moving, .refit_limit = 1e30};
    auto mesh = this->triangles(40);
    typename TestFixture::Scene scene;
    const std::uint32_t id = scene.add(mesh);
    EXPECT_EQ(scene.commit(moving).left_out, 20u);
    for (auto& vertex : mesh.vertices) vertex.x += TypeParam(0.25);
    scene.update(id, mesh);
    CommitReport report = scene.commit(moving);
    EXPECT_EQ(report.trees_refitted, 1u);
    EXPECT_EQ(report.left_out, 20u);
    mesh.vertices[0].x = this->nan;
    scene.update(id, mesh);
    report = scene.commit(moving);
    EXPECT_EQ(report.left_out, 21u);
    EXPECT_EQ(this->refusal(scene, moving),
              "geometry 0: triangle 0: not finite, out of range or inverted, as are 20 others");
}

TYPED_TEST(LeftOut, NothingIsLeft) {
    auto mesh = this->triangles(2);
    mesh.triangles = {{3, 4, 5}, {3, 4, 5}, {3, 4, 5}};
    for (const Usage usage : {Usage::fixed, Usage::moving}) {
        typename TestFixture::Scene scene;
        scene.add(mesh);
        const CommitReport report = scene.commit({.usage = usage});
        EXPECT_EQ(report.left_out, 3u);
        EXPECT_EQ(report.triangles, 3u);
        EXPECT_NE(this->refusal(scene, {.usage = usage}), "no error");
    }
}

TYPED_TEST(LeftOut, Shapes) {
    const std::vector<BasicSphere<TypeParam>> spheres = {
        {{0, 0, 0}, 1}, {{0, 0, 0}, -1}, {{5, 0, 0}, 0}, {{this->nan, 0, 0}, 1}};
    const std::vector<BasicCapsule<TypeParam>> capsules = {{{0, 0, 0}, {0, 0, this->nan}, 1},
                                                           {{0, 0, 0}, {0, 0, 0}, 1}};
    const std::vector<BasicVec3<TypeParam>> points = {{0, 0, 0}, {TypeParam(2e12), 0, 0}};
    const std::vector<BasicAabb<TypeParam>> boxes = {{{0, 0, 0}, {1, 1, 1}},
                                                     {{1, 0, 0}, {0, 1, 1}}};
    const auto expect = [&](auto add, std::uint64_t left_out, const std::string& refused) {
        typename TestFixture::Scene scene;
        add(scene);
        EXPECT_EQ(scene.commit().left_out, left_out);
        EXPECT_EQ(scene.commit().left_out, left_out);
        const std::string wanted =
            "geometry 0: " + refused + ": not finite, out of range or inverted" +
            (left_out == 1   ? ""
             : left_out == 2 ? ", as is 1 other"
                             : ", as are " + std::to_string(left_out - 1) + " others");
        EXPECT_EQ(this->refusal(scene, {}), wanted);
        EXPECT_EQ(this->refusal(scene, {.quality = Quality::high}), wanted);
    };
    expect([&](auto& scene) { scene.add(std::span<const BasicSphere<TypeParam>>(spheres)); }, 2,
           "sphere 1");
    expect([&](auto& scene) { scene.add(std::span<const BasicCapsule<TypeParam>>(capsules)); }, 1,
           "capsule 0");
    expect([&](auto& scene) { scene.add(std::span<const BasicVec3<TypeParam>>(points), 1); }, 1,
           "point 1");
    expect(
        [&](auto& scene) {
            using User = BasicUserGeometry<TypeParam>;
            scene.add(User(boxes, [](std::uint32_t, const BasicRay<TypeParam>&,
                                     BasicHit<TypeParam>&) { return false; }));
        },
        1, "primitive 1");
}

/// Each scene answers for its own.
TYPED_TEST(LeftOut, PlacedScenesAreNotAskedAgain) {
    typename TestFixture::Scene inner(this->triangles(4)), outer;
    outer.add(inner, typename TestFixture::Scene::Transform{});
    EXPECT_EQ(outer.commit().left_out, 0u);
    EXPECT_EQ(this->refusal(outer, {}), "no error");
}

}  // namespace
}  // namespace raydix
