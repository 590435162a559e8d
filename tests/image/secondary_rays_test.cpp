// src/image/secondary_rays.cpp, primitive_lookup.h, ray_files.cpp
#include <raydix/error.h>
#include <raydix/rays.h>
#include <raydix/trace.h>

#include <algorithm>
#include <cstring>
#include <numeric>

#include "base/double3.h"
#include "build/shapes.h"
#include "image/primitive_lookup.h"
#include "rays/hemisphere_rays.h"
#include "rays/ray_order.h"
#include "support/support.h"

namespace raydix {
namespace {

struct Batch {
    Mesh mesh = test::ball_and_boxes();
    Bvh bvh = build_bvh(mesh);
    std::vector<std::uint32_t> pixels;
    std::vector<Ray> rays =
        make_primary_rays(Camera{"", {1, 3, 8}, {0, 1, 0}, {0, 1, 0}, 50}, 48, 36, &pixels);
    std::vector<Hit> hits = trace(bvh, rays);
    std::size_t hit_count() const {
        return static_cast<std::size_t>(
            std::count_if(hits.begin(), hits.end(), [](const Hit& h) { return h.hit(); }));
    }
    std::vector<Ray> secondary(const SecondaryOptions& options) const {
        return make_secondary_rays(bvh, rays, hits, pixels, options);
    }
};

std::vector<std::string> as_sorted_bytes(const std::vector<Ray>& rays) {
    std::vector<std::string> bytes;
    for (const Ray& ray : rays)
        bytes.emplace_back(reinterpret_cast<const char*>(&ray), sizeof(Ray));
    std::sort(bytes.begin(), bytes.end());
    return bytes;
}

TEST(PrimitiveLookup, FindsEveryTriangleByItsId) {
    const Batch batch;
    const PrimitiveLookup lookup(batch.bvh);
    for (std::uint32_t id = 0; id < batch.mesh.triangles.size(); ++id) {
        ASSERT_TRUE(lookup.contains(id));
        const Vec3 expected = batch.mesh.vertices[batch.mesh.triangles[id][1]];
        EXPECT_EQ(lookup.triangle(id).v1.x, expected.x);
        EXPECT_EQ(lookup.triangle(id).v1.y, expected.y);
    }
    EXPECT_FALSE(lookup.contains(static_cast<std::uint32_t>(batch.mesh.triangles.size())));
    EXPECT_FALSE(lookup.contains(no_primitive));
}

TEST(SecondaryRays, StartBeforeEveryHitAndLeaveItsSurface) {
    const Batch batch;
    ASSERT_GT(batch.hit_count(), 500u);
    ASSERT_LT(batch.hit_count(), batch.hits.size());
    const auto rays = batch.secondary({.kind = RayKind::diffuse, .sorted = false});
    ASSERT_EQ(rays.size(), 32 * batch.hit_count());
    const double diagonal = diagonal_of(batch.bvh.bounds());
    std::size_t next = 0;
    for (std::size_t i = 0; i < batch.hits.size(); ++i) {
        if (!batch.hits[i].hit()) continue;
        const Triangle& t = batch.mesh.triangles[batch.hits[i].prim];
        const auto& v = batch.mesh.vertices;
        const Vec3 normal =
            normal_toward(normal_of(v[t[0]], v[t[1]], v[t[2]]), batch.rays[i].direction);
        const Double3 at =
            Double3(batch.rays[i].origin) + Double3(batch.rays[i].direction) * batch.hits[i].t;
        for (int k = 0; k < 32; ++k, ++next) {
            EXPECT_GT(dot(Double3(rays[next].direction), Double3(normal)), 0.0);
            EXPECT_NEAR(length(at - Double3(rays[next].origin)), 3e-6 * diagonal, 1e-6);
            EXPECT_EQ(rays[next].tmax, infinity);
        }
    }
    EXPECT_EQ(next, rays.size());
}

TEST(SecondaryRays, AoRaysEndAtTheRadius) {
    const Batch batch;
    for (const Ray& ray : batch.secondary({.ao_radius = 0.75f})) ASSERT_EQ(ray.tmax, 0.75f);
    const float expected = static_cast<float>(0.05 * diagonal_of(batch.bvh.bounds()));
    for (const Ray& ray : batch.secondary({.samples = 3})) ASSERT_FLOAT_EQ(ray.tmax, expected);
}

TEST(SecondaryRays, OrderChangesNothingElse) {
    const Batch batch;
    const auto plain = batch.secondary({.kind = RayKind::diffuse, .sorted = false});
    const auto sorted = batch.secondary({.kind = RayKind::diffuse});
    const auto shuffled = batch.secondary({.kind = RayKind::diffuse_shuffled});
    EXPECT_EQ(as_sorted_bytes(plain), as_sorted_bytes(sorted));
    EXPECT_EQ(as_sorted_bytes(plain), as_sorted_bytes(shuffled));
    EXPECT_NE(std::memcmp(plain.data(), shuffled.data(), plain.size() * sizeof(Ray)), 0);
    const Aabb scene = batch.bvh.bounds();
    const float largest =
        std::max({scene.hi.x - scene.lo.x, scene.hi.y - scene.lo.y, scene.hi.z - scene.lo.z});
    const Aabb box = end_point_box(sorted, 1.5f * largest);
    for (std::size_t i = 1; i < sorted.size(); ++i)
        ASSERT_LE(ray_key(sorted[i - 1], box), ray_key(sorted[i], box));
}

TEST(SecondaryRays, AreTheSameForEveryThreadCount) {
    const Batch batch;
    for (const RayKind kind : {RayKind::ao, RayKind::diffuse, RayKind::diffuse_shuffled}) {
        const auto one = batch.secondary({.kind = kind, .seed = 9, .threads = 1});
        for (const int threads : {2, 7}) {
            const auto many = batch.secondary({.kind = kind, .seed = 9, .threads = threads});
            ASSERT_EQ(one.size(), many.size());
            EXPECT_EQ(std::memcmp(one.data(), many.data(), one.size() * sizeof(Ray)), 0);
        }
    }
}

TEST(SecondaryRays, NoHitsNoRays) {
    const Batch batch;
    const std::vector<Hit> misses(batch.rays.size());
    EXPECT_TRUE(make_secondary_rays(batch.bvh, batch.rays, misses, batch.pixels, {}).empty());
    EXPECT_TRUE(make_secondary_rays(batch.bvh, {}, {}, {}, {}).empty());
    EXPECT_TRUE(make_secondary_rays(build_bvh(Mesh{}), {}, {}, {}, {}).empty());
}

TEST(SecondaryRays, RefuseWhatMakesNoSense) {
    Batch batch;
    EXPECT_THROW((void)batch.secondary({.kind = RayKind::primary}), InputError);
    EXPECT_THROW((void)batch.secondary({.samples = 0}), InputError);
    EXPECT_THROW((void)batch.secondary({.samples = 1025}), InputError);
    EXPECT_THROW((void)batch.secondary({.ao_radius = -1.0f}), InputError);
    const std::vector<Vec3> points{{0, 0, 0}, {1, 1, 1}};
    EXPECT_THROW((void)make_secondary_rays(build_bvh(points), {}, {}, {}, {}), InputError);
    batch.hits[7].prim = 4000000;
    batch.hits[9].prim = 4000001;
    try {
        (void)batch.secondary({});
        ADD_FAILURE();
    } catch (const InputError& error) {
        EXPECT_STREQ(error.what(), "hit 7: the tree holds no triangle 4000000");
    }
    batch.pixels.pop_back();
    EXPECT_THROW((void)batch.secondary({}), InputError);
}

TEST(RayKindNames, AreThoseOfTheCommandLine) {
    EXPECT_EQ(ray_kind_name(RayKind::primary), "primary");
    EXPECT_EQ(ray_kind_name(RayKind::ao), "ao");
    EXPECT_EQ(ray_kind_name(RayKind::diffuse), "diffuse");
    EXPECT_EQ(ray_kind_name(RayKind::diffuse_shuffled), "diffuse_shuffled");
}

TEST(RayFiles, ComeBackBitForBit) {
    const test::TempFolder folder;
    const Batch batch;
    const auto file = folder.path() / "rays.npy";
    save_rays(file, batch.rays);
    const auto back = load_rays(file);
    ASSERT_EQ(back.size(), batch.rays.size());
    EXPECT_EQ(std::memcmp(back.data(), batch.rays.data(), back.size() * sizeof(Ray)), 0);
    save_rays(file, {});
    EXPECT_TRUE(load_rays(file).empty());
    EXPECT_THROW((void)load_rays(folder.path() / "none.npy"), InputError);
    save_hits(file, batch.hits);
    EXPECT_THROW((void)load_rays(file), InputError);
    EXPECT_EQ(std::filesystem::file_size(file) % 64, batch.hits.size() * sizeof(Hit) % 64);
}

}  // namespace
}  // namespace raydix
