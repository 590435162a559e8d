// Shared arrays that changed since the commit are no longer what the scene answers from: files of
// it are refused.
#include "engine/shared_arrays.h"

#include <gtest/gtest.h>
#include <raydix/rdx_scene.h>

#include <limits>
#include <string>

#include "support/message.h"
#include "support/support.h"

namespace raydix::test {
namespace {

template <class Scalar>
BasicMesh<Scalar> soup(std::size_t count, std::uint64_t seed) {
    const Mesh in_float = random_soup(count, seed);
    BasicMesh<Scalar> mesh;
    mesh.triangles = in_float.triangles;
    for (const Vec3 v : in_float.vertices) mesh.vertices.push_back({v.x, v.y, v.z});
    return mesh;
}

template <class Scalar>
class SharedArraysTest : public testing::Test {
protected:
    /// One tree for a mesh of the scene's own and two shared ones, 4 and 6; and one without area.
    SharedArraysTest() {
        b.vertices.push_back({2, 2, 2});
        b.vertices.push_back({3, 3, 3});
        const auto last = static_cast<std::uint32_t>(b.vertices.size()) - 1;
        b.triangles.push_back({last - 1, last, last});
        scene.add(soup<Scalar>(20, 1));
        scene.share(a, {.id = 4});
        scene.share(b, {.id = 6});
    }
    std::string message(const BasicScene<Scalar>& of) const {
        return message_of([&] { save_rdx(folder_.path() / "x.rdx", of); });
    }
    std::string refusal(int geometry, int triangle) const {
        return (folder_.path() / "x.rdx").string() + ": not written: scenes: geometry " +
               std::to_string(geometry) +
               ": its shared arrays changed since the commit, at triangle " +
               std::to_string(triangle);
    }

    BasicMesh<Scalar> a = soup<Scalar>(30, 2), b = soup<Scalar>(40, 3);
    BasicScene<Scalar> scene;

private:
    TempFolder folder_;
};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(SharedArraysTest, Scalars);

TYPED_TEST(SharedArraysTest, EveryChangeIsNamed) {
    for (const bool compact : {false, true})
        for (const Quality quality : {Quality::fast, Quality::high}) {
            this->scene.commit({.quality = quality, .compact = compact});
            EXPECT_EQ(this->message(this->scene), "no error");
            auto& vertex = this->b.vertices[this->b.triangles[17][1]];
            vertex.y += 1;
            EXPECT_EQ(this->message(this->scene), this->refusal(6, 17));
            vertex.y -= 1;
            auto& corner = this->a.triangles[8][2];
            const std::uint32_t before = corner;
            corner = before == 0 ? 1 : 0;
            EXPECT_EQ(this->message(this->scene), this->refusal(4, 8));
            corner = static_cast<std::uint32_t>(this->a.vertices.size());
            EXPECT_EQ(this->message(this->scene), this->refusal(4, 8));
            corner = before;
            EXPECT_EQ(this->message(this->scene), "no error");
        }
}

TYPED_TEST(SharedArraysTest, TrianglesThatComeAndGoAreNamed) {
    this->scene.commit();
    auto& flat = this->b.triangles[40];
    const Triangle before = flat;
    flat = {0, 1, 4};
    EXPECT_EQ(this->message(this->scene), this->refusal(6, 40));
    flat = before;
    auto& vertex = this->b.vertices[this->b.triangles[3][0]];
    const auto place = vertex;
    vertex.x = std::numeric_limits<TypeParam>::quiet_NaN();
    EXPECT_EQ(this->message(this->scene), this->refusal(6, 3));
    vertex = place;
    EXPECT_EQ(this->message(this->scene), "no error");
}

TYPED_TEST(SharedArraysTest, ThoseOfInstancesToo) {
    this->scene.commit();
    BasicScene<TypeParam> outer;
    outer.add(this->scene, {});
    outer.commit();
    EXPECT_EQ(this->message(outer), "no error");
    this->a.vertices[this->a.triangles[0][0]].z = 5;
    EXPECT_EQ(this->message(outer), this->refusal(4, 0));
}

}  // namespace
}  // namespace raydix::test
