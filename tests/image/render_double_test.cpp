// Cameras, rays and pictures of scenes in double beside those in float: the same at the origin and
// far from it, where float has steps of half a unit.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/picture.h>
#include <raydix/rays.h>
#include <raydix/scene.h>
#include <raydix/wide.h>

#include <algorithm>
#include <cmath>

#include "base/double3.h"
#include "build/shapes.h"
#include "image/pictures.h"
#include "support/double_scenes.h"
#include "support/message.h"
#include "support/support.h"

namespace raydix::test {
namespace {

CameraD moved_camera(const Camera& camera, Vec3d by) {
    const auto at = [&](Vec3 p) { return Vec3d{p.x + by.x, p.y + by.y, p.z + by.z}; };
    return {camera.name,
            at(camera.position),
            at(camera.target),
            {camera.up.x, camera.up.y, camera.up.z},
            double{camera.vfov}};
}

TEST(RenderDouble, PicturesAreThoseOfFloatWhereverTheSceneLies) {
    const Mesh mesh = ball_and_boxes();
    const Scene scene(mesh);
    for (const Vec3d by : {Vec3d{0, 0, 0}, utm_place}) {
        const SceneD there(in_double(mesh, 1.0, by));
        for (const View view : all_views) {
            const RenderOptions options = options_for(view);
            const CameraD camera = moved_camera(camera_before_ball(), by);
            if (view == View::steps) {
                EXPECT_NE(message_of([&] {
                              static_cast<void>(render(there, camera, options));
                          }).find("steps"),
                          std::string::npos);
                continue;
            }
            const Picture wanted = render(scene, camera_before_ball(), options);
            const Picture found = render(there, camera, options);
            // Rays at edges, and the noise of light that is gathered from a little elsewhere.
            EXPECT_LE(count_different(wanted, found), found.pixels.size() / 20) << view_name(view);
            RenderOptions alone = options;
            alone.threads = 1;
            EXPECT_TRUE(same_pixels(found, render(there, camera, alone)));
        }
    }
}

TEST(RenderDouble, PrimaryRaysAreNotRounded) {
    const CameraD camera = moved_camera(camera_before_ball(), utm_place);
    std::vector<std::uint32_t> pixels, wanted_pixels;
    const std::vector<RayD> rays = make_primary_rays(camera, 16, 9, &pixels);
    const std::vector<Ray> wanted = make_primary_rays(camera_before_ball(), 16, 9, &wanted_pixels);
    EXPECT_EQ(pixels, wanted_pixels);
    ASSERT_EQ(rays.size(), wanted.size());
    std::size_t finer = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        EXPECT_EQ(rays[i].origin, camera.position);
        EXPECT_NEAR(length(Double3(rays[i].direction)), 1.0, 4e-16);
        EXPECT_NEAR(rays[i].direction.x, double{wanted[i].direction.x}, 1e-6);
        finer += rays[i].direction.x != static_cast<float>(rays[i].direction.x);
    }
    EXPECT_GT(finer, rays.size() / 2);
}

TEST(RenderDouble, SecondaryRaysStartJustOutside) {
    const Mesh mesh = ball_and_boxes();
    const SceneD there(in_double(mesh, 1.0, utm_place));
    const auto rays = make_primary_rays(moved_camera(camera_before_ball(), utm_place), 32, 24);
    const auto hits = trace(there, rays);
    const std::vector<std::uint32_t> pixels(rays.size(), 7);
    const SecondaryOptions options{.kind = RayKind::ao, .samples = 2, .sorted = false};
    const auto secondary = make_secondary_rays(there, rays, hits, pixels, options);
    const AabbD box = there.bounds();
    const double diagonal = length(Double3(box.hi) - Double3(box.lo));
    std::size_t k = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!hits[i].hit()) continue;
        const Double3 point = Double3(rays[i].origin) + Double3(rays[i].direction) * hits[i].t;
        ASSERT_LT(k + 1, secondary.size());
        for (int n = 0; n < 2; ++n, ++k) {
            const double back = length(Double3(secondary[k].origin) - point);
            EXPECT_NEAR(back, 3e-6 * diagonal, 0x1p-24 * diagonal + 4e-9);
        }
    }
    EXPECT_EQ(k, secondary.size());
    EXPECT_GT(k, 100u);
    const std::span<const std::uint32_t> few(pixels.data(), 3);
    EXPECT_NE(message_of([&] {
                  static_cast<void>(make_secondary_rays(there, rays, hits, few, options));
              }).find("equally many"),
              std::string::npos);
    auto wrong = hits;
    wrong.front() = {};
    wrong.front().prim = 1'000'000, wrong.front().geometry = 0;
    EXPECT_NE(message_of([&] {
                  static_cast<void>(make_secondary_rays(there, rays, wrong, pixels, options));
              }).find("hit 0"),
              std::string::npos);
}

TEST(RenderDouble, TheFittedCameraSeesAll) {
    const AabbD box{utm_place, {utm_place.x + 2, utm_place.y + 1, utm_place.z + 1}};
    const CameraD camera = fit_camera(box);
    const Camera wanted = fit_camera(Aabb{{-1, -0.5f, -0.5f}, {1, 0.5f, 0.5f}});
    EXPECT_EQ(camera.target, (Vec3d{500'001, 4'500'000.5, 250.5}));
    EXPECT_NEAR(camera.position.x - camera.target.x, wanted.position.x - wanted.target.x, 1e-6);
    EXPECT_NEAR(camera.position.z - camera.target.z, wanted.position.z - wanted.target.z, 1e-6);
    EXPECT_EQ(fit_camera(AabbD{{1, 0, 0}, {0, 1, 1}}).position, CameraD{}.position);
}

TEST(RenderDouble, FiguresOfTheWideTree) {
    const Mesh mesh = random_soup(3000, 5);
    const WideBvhStats found = wide_stats_of(in_double(mesh)),
                       wanted = build_wide_bvh(mesh).stats();
    EXPECT_EQ(found.references, wanted.references);
    EXPECT_EQ(found.width, 8);
    EXPECT_NEAR(found.sah, wanted.sah, 0.1 * wanted.sah);
    EXPECT_EQ(found.bytes, found.node_bytes + found.triangle_bytes);
    EXPECT_EQ(wide_stats_of(MeshViewD{}).nodes, 0u);
}

}  // namespace
}  // namespace raydix::test
