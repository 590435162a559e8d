// A change for which memory ends leaves things as they were, whichever of its allocations fails;
// result_limit_test.cpp has the allocations of this program.
#include <gtest/gtest.h>
#include <raydix/bvh.h>
#include <raydix/double.h>
#include <raydix/refit.h>
#include <raydix/scene.h>
#include <raydix/user_geometry.h>

#include <cstdint>
#include <cstring>
#include <new>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "exec/memory.h"
#include "layout/refit_walk.h"
#include "limits/memory_end.h"
#include "support/support.h"

namespace raydix {
namespace {

/// before(), then change() with an end of memory, then after(); for each allocation of change().
/// Returns how many there are.
template <class Before, class Change, class After>
long at_each_end(const Before& before, const Change& change, const After& after) {
    for (long k = 0;; ++k) {
        before();
        try {
            const MemoryEnd end(k);
            change();
            return k;
        } catch (const std::bad_alloc&) {
        }
        SCOPED_TRACE("allocation " + std::to_string(k));
        after();
    }
}

template <class Scalar>
BasicSphere<Scalar> ball_at(Scalar x) {
    return {{x, 0, 5}, 1};
}
template <class Scalar>
bool hits_at(const BasicScene<Scalar>& scene, Scalar x) {
    return closest_hit(scene, {.origin = {x, 0, 0}, .direction = {0, 0, 1}}).hit();
}

template <class Scalar>
class MemoryEnds : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(MemoryEnds, Scalars);

/// Or the next add gave the same id again and dropped what it was given.
TYPED_TEST(MemoryEnds, AddLeavesTheSceneAsItWas) {
    using Scene = BasicScene<TypeParam>;
    const std::vector<BasicSphere<TypeParam>> first{ball_at<TypeParam>(0)},
        second{ball_at<TypeParam>(10)};
    for (const auto& options : {GeometryOptions{}, GeometryOptions{.id = 7}}) {
        Scene scene;
        const long ends = at_each_end(
            [&] {
                scene = Scene();
                scene.commit();
            },
            [&] { scene.add(first, options); },
            [&] {
                EXPECT_EQ(scene.size(), 0u);
                EXPECT_TRUE(scene.committed());
                EXPECT_EQ(scene.add(second, options), options.id.value_or(0));
                scene.commit();
                EXPECT_TRUE(hits_at<TypeParam>(scene, 10));
                EXPECT_FALSE(hits_at<TypeParam>(scene, 0));
            });
        EXPECT_GE(ends, 3);
    }
}

/// Or the memory of arrays was freed twice.
TYPED_TEST(MemoryEnds, ArraysAreFreedOnce) {
    const BasicMesh<TypeParam> mesh{"m", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    { SCOPED_TRACE("the first one of a thread takes memory that stays"); }
    BasicScene<TypeParam> scene;
    std::uint64_t held = 0;
    const long ends = at_each_end(
        [&] {
            scene = BasicScene<TypeParam>();
            held = memory_count().now();
        },
        [&] { scene.add(mesh); },
        [&] {
            EXPECT_EQ(scene.size(), 0u);
            EXPECT_EQ(memory_count().now(), held);
        });
    EXPECT_GE(ends, 5);
}

/// `scale` times random triangles.
template <class Scalar>
BasicMesh<Scalar> soup(Scalar scale) {
    const Mesh in_float = test::random_soup(3000, 1);
    BasicMesh<Scalar> mesh;
    mesh.triangles = in_float.triangles;
    for (const Vec3 v : in_float.vertices)
        mesh.vertices.push_back({scale * v.x, scale * v.y, scale * v.z});
    return mesh;
}
/// What tells trees of boxes and corners apart.
std::vector<float> boxes_of(const Bvh& tree) {
    std::vector<float> all;
    for (const BvhNode& node : tree.nodes())
        for (const Vec3 p : {node.lo, node.hi}) all.insert(all.end(), {p.x, p.y, p.z});
    for (const LeafTriangle& t : tree.triangles()) all.insert(all.end(), {t.v0.x, t.v1.y, t.v2.z});
    return all;
}
std::vector<double> boxes_of(const BvhD& tree) {
    std::vector<double> all;
    for (const float x : boxes_of(tree.tree())) all.push_back(x);
    for (const LeafTriangleD& t : tree.triangles()) all.insert(all.end(), {t.v0.x, t.v1.y, t.v2.z});
    return all;
}

/// Or some of its boxes were around the new places and others around the old ones.
TYPED_TEST(MemoryEnds, RefitLeavesTheTreeAsItWas) {
    const BasicMesh<TypeParam> mesh = soup<TypeParam>(1), moved = soup<TypeParam>(3);
    auto tree = build_bvh(mesh);
    auto before = boxes_of(tree);
    const long ends = at_each_end([] {}, [&] { refit(tree, moved, 2); },
                                  [&] { ASSERT_TRUE(boxes_of(tree) == before); });
    EXPECT_GE(ends, 5);
    EXPECT_FALSE(boxes_of(tree) == before);
}

/// Of deep trees the walk needs memory of its own: it comes before the first change too.
TEST(MemoryEndsInDepth, RefitLeavesTheTreeAsItWas) {
    const Mesh mesh = soup<float>(1), moved = soup<float>(3);
    const Bvh tree = build_bvh(mesh);
    const TriangleSource source{moved.vertices.data(), moved.triangles.data(),
                                moved.vertices.size()};
    std::vector<BvhNode> nodes(tree.nodes().begin(), tree.nodes().end()), usual = nodes;
    std::vector<LeafTriangle> copies(tree.triangles().size());
    RefitWalk(source, tree.order(), usual.data(), copies.data(), tree.max_depth()).run();
    const auto are_equal = [](std::span<const BvhNode> a, std::span<const BvhNode> b) {
        return std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
    };
    const RefitWalk walk(source, tree.order(), nodes.data(), copies.data(), 100'000);
    const long ends = at_each_end([] {}, [&] { walk.run(); },
                                  [&] { ASSERT_TRUE(are_equal(nodes, tree.nodes())); });
    EXPECT_GE(ends, 4);
    EXPECT_TRUE(are_equal(nodes, usual));
}

/// Or the next trace of that thread wrote past what it had kept from the one that failed.
TEST(MemoryEndsInATrace, TheNextOneOfTheThreadIsWhole) {
    const Mesh mesh = test::random_soup(300, 4, 0.2f);
    Scene inner(mesh), flat(mesh), placed, balls;
    placed.add(inner, Transform{});
    placed.add(inner, Transform{});
    placed.add(mesh);
    std::vector<Aabb> boxes;
    for (const Triangle& t : mesh.triangles) {
        boxes.push_back(empty_box());
        for (const std::uint32_t corner : t)
            boxes.back() = unite(boxes.back(), Aabb{mesh.vertices[corner], mesh.vertices[corner]});
    }
    balls.add(UserGeometry(boxes, [&boxes](std::uint32_t k, const Ray& ray, Hit& hit) {
        hit.t = (boxes[k].hi.z - ray.origin.z) / ray.direction.z;
        const float x = ray.origin.x + hit.t * ray.direction.x,
                    y = ray.origin.y + hit.t * ray.direction.y;
        return hit.t >= ray.tmin && hit.t <= ray.tmax && x > boxes[k].lo.x && x < boxes[k].hi.x &&
               y > boxes[k].lo.y && y < boxes[k].hi.y;
    }));
    balls.add(mesh);
    placed.commit();
    balls.commit();
    std::vector<Ray> rays;
    for (std::uint32_t k = 0; k < 2000; ++k)
        rays.push_back({{float(k % 50) / 50, float(k) / 2000, -1}, 0, {0.1f, 0.2f, 1}, infinity});
    for (const Scene* scene : {&flat, &placed, &balls})
        for (const SimdPath path : {SimdPath::automatic, SimdPath::single, SimdPath::packet,
                                    SimdPath::stream, SimdPath::sorted}) {
            const SceneTraceOptions options{.threads = 1, .path = path};
            const std::vector<Hit> wanted = trace(*scene, rays, options);
            bool ended = true;
            for (long k = 0; ended; ++k)
                std::thread([&] {
                    std::vector<Hit> hits(rays.size());
                    ended = false;
                    try {
                        const MemoryEnd end(k);
                        trace(*scene, rays, hits, options);
                    } catch (const std::bad_alloc&) {
                        ended = true;
                    }
                    trace(*scene, rays, hits, options);
                    EXPECT_EQ(hits, wanted) << k;
                }).join();
        }
}

}  // namespace
}  // namespace raydix
