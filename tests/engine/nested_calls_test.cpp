// Functions of the caller's that ask the library from within a call: the answers of those that know
// theirs beforehand.
#include <gtest/gtest.h>
#include <raydix/scene.h>
#include <raydix/scene_queries.h>
#include <raydix/user_geometry.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "support/random.h"
#include "support/support.h"

namespace raydix {
namespace {

constexpr std::uint32_t triangles = 300;

template <class Scalar>
using RayOf = BasicRay<Scalar>;
template <class Scalar>
using HitOf = BasicHit<Scalar>;

template <class Scalar>
RayOf<Scalar> ray_from(Vec3 from, Vec3 to) {
    RayOf<Scalar> ray;
    ray.origin = {from.x, from.y, from.z};
    ray.direction = {to.x - from.x, to.y - from.y, to.z - from.z};
    return ray;
}

template <class Scalar>
std::vector<RayOf<Scalar>> rays_to(std::size_t count, std::uint64_t seed) {
    test::Random random(seed);
    std::vector<RayOf<Scalar>> rays;
    for (std::size_t i = 0; i < count; ++i)
        rays.push_back(ray_from<Scalar>(random.in(-1, 2), random.in(0, 1)));
    return rays;
}

auto mesh_of(float, std::uint64_t seed) { return test::random_soup(triangles, seed, 0.3f); }
auto mesh_of(double, std::uint64_t seed) {
    const Mesh mesh = test::random_soup(triangles, seed, 0.3f);
    MeshD wide;
    for (const Vec3& v : mesh.vertices) wide.vertices.push_back({v.x, v.y, v.z});
    wide.triangles = mesh.triangles;
    return wide;
}

template <class Scalar>
BasicScene<Scalar> scene_of(int meshes) {
    BasicScene<Scalar> scene;
    for (int k = 0; k < meshes; ++k) scene.add(mesh_of(Scalar{}, static_cast<std::uint64_t>(k)));
    scene.commit();
    return scene;
}

/// Each triangle asks a ray, a batch and a point of its own of the scene.
template <class Scalar>
class Questions {
public:
    explicit Questions(const BasicScene<Scalar>& scene) : scene_(scene) {}

    [[nodiscard]] bool answer(std::uint32_t geometry, std::uint32_t prim) const {
        const std::uint32_t number = geometry * triangles + prim;
        const auto rays = rays_to<Scalar>(prim % 64 == 0 ? 1500 : 3, number);
        bool odd = any_hit(scene_, rays[0]);
        odd ^= closest_hit(scene_, rays[1]).prim % 2 == 0;
        for (const HitOf<Scalar>& hit : trace(scene_, rays)) odd ^= hit.prim % 2 == 0;
        odd ^= trace_all(scene_, rays).hits.size() % 2 == 0;
        odd ^= closest_point(scene_, rays[2].origin).prim % 2 == 0;
        return odd;
    }

private:
    const BasicScene<Scalar>& scene_;
};

template <class Scalar>
class NestedCalls : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(NestedCalls, Scalars);

TYPED_TEST(NestedCalls, FiltersMayTraceTheSceneThatTheyFilter) {
    using Scalar = TypeParam;
    for (const int meshes : {1, 3}) {
        const BasicScene<Scalar> scene = scene_of<Scalar>(meshes);
        const Questions<Scalar> questions(scene);
        std::vector<char> known(static_cast<std::size_t>(meshes) * triangles);
        for (std::uint32_t i = 0; i < known.size(); ++i)
            known[i] = questions.answer(i / triangles, i % triangles);
        const auto rays = rays_to<Scalar>(10 * test::thorough + 100, 99);
        for (const int threads : {1, 8}) {
            BasicSceneTraceOptions<Scalar> by_table, by_asking;
            by_table.threads = by_asking.threads = threads;
            by_table.filter = [&](std::size_t, const RayOf<Scalar>&, const HitOf<Scalar>& hit) {
                return known[hit.geometry * triangles + hit.prim] != 0;
            };
            by_asking.filter = [&](std::size_t, const RayOf<Scalar>&, const HitOf<Scalar>& hit) {
                return questions.answer(hit.geometry, hit.prim);
            };
            const auto expected = trace(scene, rays, by_table),
                       found = trace(scene, rays, by_asking);
            std::size_t hits = 0;
            for (std::size_t i = 0; i < rays.size(); ++i) {
                hits += expected[i].hit();
                ASSERT_EQ(expected[i].prim, found[i].prim) << "ray " << i << ", " << threads;
                ASSERT_EQ(expected[i].t, found[i].t) << "ray " << i;
            }
            EXPECT_GT(hits, rays.size() / 4);
            EXPECT_EQ(trace_all(scene, rays, by_table).hits.size(),
                      trace_all(scene, rays, by_asking).hits.size());
        }
    }
}

TYPED_TEST(NestedCalls, UserGeometryMayTraceAnotherScene) {
    using Scalar = TypeParam;
    const BasicScene<Scalar> inner = scene_of<Scalar>(2);
    using Box = BasicAabb<Scalar>;
    const std::vector<Box> boxes(5, Box{{-2, -2, -2}, {3, 3, 3}});
    BasicScene<Scalar> outer;
    // Hit where the scene within is hit, by a batch of one ray.
    outer.add(BasicUserGeometry<Scalar>(
        boxes, [&](std::uint32_t prim, const RayOf<Scalar>& ray, HitOf<Scalar>& hit) {
            std::vector<RayOf<Scalar>> rays(prim + 1, ray);
            for (RayOf<Scalar>& r : rays) r.tmin = std::max(r.tmin, Scalar(prim) / 8);
            const auto found = trace(inner, rays).back();
            hit.t = found.t;
            return found.hit();
        }));
    outer.add(mesh_of(Scalar{}, 7));
    outer.commit();
    const auto rays = rays_to<Scalar>(1000, 5);
    const auto mesh_alone = [] {
        BasicScene<Scalar> scene;
        scene.add(mesh_of(Scalar{}, 7));
        scene.commit();
        return scene;
    }();
    const auto inner_hits = trace(inner, rays), mesh_hits = trace(mesh_alone, rays);
    for (const int threads : {1, 8}) {
        BasicSceneTraceOptions<Scalar> options;
        options.threads = threads;
        const auto hits = trace(outer, rays, options);
        for (std::size_t i = 0; i < rays.size(); ++i)
            ASSERT_EQ(hits[i].t, std::min(inner_hits[i].t, mesh_hits[i].t)) << "ray " << i;
    }
}

}  // namespace
}  // namespace raydix
