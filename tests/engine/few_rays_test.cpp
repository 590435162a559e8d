// Batches of a few rays, which go without a plan: the answers of large batches, the caller's
// numbers of rays, counts and errors.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/scene.h>
#include <raydix/user_geometry.h>

#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "support/random.h"
#include "support/support.h"

namespace raydix {
namespace {

template <class Scalar>
using RayOf = BasicRay<Scalar>;
template <class Scalar>
using HitOf = BasicHit<Scalar>;

template <class Scalar>
class FewRays : public testing::Test {
protected:
    using SceneOf = BasicScene<Scalar>;

    static BasicMesh<Scalar> soup(std::uint64_t seed) {
        const Mesh mesh = test::random_soup(200, seed, 0.4f);
        BasicMesh<Scalar> out;
        for (const Vec3& v : mesh.vertices) out.vertices.push_back({v.x, v.y, v.z});
        out.triangles = mesh.triangles;
        return out;
    }
    /// Every seventh is invalid.
    static std::vector<RayOf<Scalar>> some_rays() {
        test::Random random(3);
        std::vector<RayOf<Scalar>> rays;
        for (int i = 0; i < 360; ++i) {
            const Vec3 from = random.in(-1, 2), to = random.in(0, 1);
            RayOf<Scalar> ray;
            ray.origin = {from.x, from.y, from.z};
            ray.direction = {to.x - from.x, to.y - from.y, to.z - from.z};
            if (i % 7 == 3) ray.tmin = std::numeric_limits<Scalar>::quiet_NaN();
            rays.push_back(ray);
        }
        return rays;
    }
    /// One mesh; meshes of several masks; instances, and geometry of the caller.
    static std::vector<SceneOf> scenes() {
        std::vector<SceneOf> out(3);
        out[0].add(soup(1));
        for (std::uint32_t k = 0; k < 3; ++k)
            out[1].add(soup(k), {.mask = 1u << k, .id = 10 + 5 * k});
        out[0].commit();
        out[1].commit();
        typename SceneOf::Transform to{};
        to.m[0][3] = Scalar(0.5);
        out[2].add(out[1], to, {.mask = 3});
        out[2].add(out[0], typename SceneOf::Transform{});
        using Box = BasicAabb<Scalar>;
        const std::vector<Box> boxes(4, Box{{-5, -5, -5}, {5, 5, 5}});  // hold all that is hit
        out[2].add(BasicUserGeometry<Scalar>(
            boxes, [](std::uint32_t prim, const RayOf<Scalar>& ray, HitOf<Scalar>& hit) {
                hit.t = Scalar(0.3) + Scalar(prim) / 8;
                return ray.direction.x > 0 && hit.t >= ray.tmin && hit.t <= ray.tmax;
            }));
        out[2].commit();
        return out;
    }
    static bool same(const HitOf<Scalar>& a, const HitOf<Scalar>& b) {
        return a.t == b.t && a.prim == b.prim && a.u == b.u && a.v == b.v &&
               a.geometry == b.geometry && a.instance == b.instance;
    }

    /// `of(part)`: the options of rays `first` to `first` + n - 1.
    template <class Of>
    static void expect_the_same(const SceneOf& scene, const Of& of) {
        const std::vector<RayOf<Scalar>> rays = some_rays();
        const std::span<const RayOf<Scalar>> all(rays);
        const std::vector<HitOf<Scalar>> hits = trace(scene, all, of(0, rays.size()));
        std::vector<std::uint8_t> occluded(rays.size());
        trace_any(scene, all, occluded, of(0, rays.size()));
        for (std::size_t n = 1; n <= 9; ++n)
            for (std::size_t first = 0; first + n <= rays.size(); first += n) {
                std::vector<HitOf<Scalar>> found(n);
                std::vector<std::uint8_t> met(n, 9);
                const TraceCounts closest =
                    trace(scene, all.subspan(first, n), std::span(found), of(first, n));
                const TraceCounts any = trace_any(scene, all.subspan(first, n), met, of(first, n));
                std::uint64_t hit_count = 0, invalid = 0;
                for (std::size_t k = 0; k < n; ++k) {
                    hit_count += found[k].hit();
                    invalid += !(rays[first + k].tmin == rays[first + k].tmin);
                    ASSERT_TRUE(same(found[k], hits[first + k])) << first << " + " << k;
                    ASSERT_EQ(met[k], occluded[first + k]) << first << " + " << k;
                }
                for (const TraceCounts& counts : {closest, any}) {
                    ASSERT_EQ(counts.rays, n);
                    ASSERT_EQ(counts.hits, hit_count);
                    ASSERT_EQ(counts.invalid_rays, invalid);
                }
            }
    }
};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(FewRays, Scalars);

TYPED_TEST(FewRays, AnswersAreThoseOfALargeBatch) {
    for (const auto& scene : TestFixture::scenes())
        for (const SimdPath path : {SimdPath::automatic, SimdPath::single})
            TestFixture::expect_the_same(scene, [&](std::size_t, std::size_t) {
                BasicSceneTraceOptions<TypeParam> options;
                options.path = path;
                return options;
            });
}

TYPED_TEST(FewRays, EachHasItsMask) {
    std::vector<std::uint32_t> masks;
    for (std::uint32_t i = 0; i < 360; ++i) masks.push_back(i % 8);
    for (const auto& scene : TestFixture::scenes())
        TestFixture::expect_the_same(scene, [&](std::size_t first, std::size_t n) {
            BasicSceneTraceOptions<TypeParam> options;
            options.masks = std::span(masks).subspan(first, n);
            return options;
        });
}

TYPED_TEST(FewRays, FiltersAreToldTheCallersNumbers) {
    const std::vector<RayOf<TypeParam>> rays = TestFixture::some_rays();
    std::size_t wrong = 0;
    for (const auto& scene : TestFixture::scenes())
        TestFixture::expect_the_same(scene, [&](std::size_t first, std::size_t n) {
            BasicSceneTraceOptions<TypeParam> options;
            options.threads = 1;
            options.filter = [&, first, n](std::size_t k, const RayOf<TypeParam>& ray,
                                           const HitOf<TypeParam>& hit) {
                wrong += k >= n || std::memcmp(&ray.direction, &rays[first + k].direction,
                                               sizeof ray.direction) != 0;
                return (hit.prim + first + k) % 3 != 0;
            };
            return options;
        });
    EXPECT_EQ(wrong, 0u);
}

TYPED_TEST(FewRays, UserGeometryIsToldTheCallersNumbers) {
    using Box = BasicAabb<TypeParam>;
    const std::vector<RayOf<TypeParam>> rays = TestFixture::some_rays();
    const RayOf<TypeParam>* part = nullptr;
    std::size_t wrong = 0, asked = 0;
    BasicScene<TypeParam> scene;
    scene.add(BasicUserGeometry<TypeParam>(
        std::vector<Box>(3, Box{{0, 0, 0}, {1, 1, 1}}),
        [&](std::uint32_t, const BasicRaysAtPrimitive<TypeParam>& at) {
            for (std::uint32_t k = 0; k < at.count(); ++k, ++asked)
                wrong += std::memcmp(&part[at.place(k)].direction, &at.ray(k).direction,
                                     sizeof(RayOf<TypeParam>{}.direction)) != 0;
        }));
    scene.commit();
    for (std::size_t n = 1; n <= 9; ++n)
        for (std::size_t first = 0; first + n <= rays.size(); first += n) {
            part = rays.data() + first;
            std::vector<BasicHit<TypeParam>> hits(n);
            trace(scene, std::span<const RayOf<TypeParam>>(part, n), std::span(hits),
                  {.threads = 1});
        }
    EXPECT_EQ(wrong, 0u);
    EXPECT_GT(asked, 100u);
}

TYPED_TEST(FewRays, OptionsAreChecked) {
    const std::vector<BasicRay<TypeParam>> rays(3);
    const std::vector<std::uint32_t> masks(2);
    for (const auto& scene : TestFixture::scenes()) {
        BasicSceneTraceOptions<TypeParam> threads, isa, path, few_masks;
        threads.threads = 1025;
        isa.isa = "abacus";
        path.path = static_cast<SimdPath>(77);
        few_masks.masks = masks;
        for (const auto& options : {threads, isa, path, few_masks})
            EXPECT_THROW(static_cast<void>(trace(scene, rays, options)), InputError);
    }
}

}  // namespace
}  // namespace raydix
