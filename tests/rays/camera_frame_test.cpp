// src/rays/camera_frame.h, primary_rays.cpp, fit_camera.cpp
#include "rays/camera_frame.h"

#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/rays.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace raydix {
namespace {

Camera camera_at(Vec3 position, Vec3 target, Vec3 up, float vfov) {
    return {"test", position, target, up, vfov};
}

/// The direction of `ray` is (x, y, z) made unit.
void expect_direction(const Ray& ray, double x, double y, double z) {
    const double size = std::sqrt(x * x + y * y + z * z);
    EXPECT_NEAR(ray.direction.x, x / size, 1e-7);
    EXPECT_NEAR(ray.direction.y, y / size, 1e-7);
    EXPECT_NEAR(ray.direction.z, z / size, 1e-7);
}

const Ray& ray_of_pixel(const std::vector<Ray>& rays, const std::vector<std::uint32_t>& pixels,
                        std::uint32_t pixel) {
    const auto found = std::find(pixels.begin(), pixels.end(), pixel);
    return rays[static_cast<std::size_t>(found - pixels.begin())];
}

TEST(PrimaryRays, PixelCentresByHand) {
    // Half the screen's height is tan 45 = 1 at distance 1, half its width 2: pixels are 1 x 1.
    std::vector<std::uint32_t> pixels;
    const auto rays =
        make_primary_rays(camera_at({1, 2, 3}, {1, 2, -7}, {0, 5, 0}, 90), 4, 2, &pixels);
    ASSERT_EQ(rays.size(), 8u);
    ASSERT_EQ(pixels.size(), 8u);
    expect_direction(ray_of_pixel(rays, pixels, 0), -1.5, 0.5, -1);   // upper left
    expect_direction(ray_of_pixel(rays, pixels, 3), 1.5, 0.5, -1);    // upper right
    expect_direction(ray_of_pixel(rays, pixels, 4), -1.5, -0.5, -1);  // lower left
    expect_direction(ray_of_pixel(rays, pixels, 6), 0.5, -0.5, -1);
    for (const Ray& ray : rays) {
        EXPECT_EQ(ray.origin.x, 1.0f);
        EXPECT_EQ(ray.origin.y, 2.0f);
        EXPECT_EQ(ray.origin.z, 3.0f);
        EXPECT_EQ(ray.tmin, 0.0f);
        EXPECT_EQ(ray.tmax, infinity);
    }
}

TEST(PrimaryRays, RightIsViewCrossUp) {
    // Looking along +x with z up, the right side of the screen is -y.
    std::vector<std::uint32_t> pixels;
    const auto rays =
        make_primary_rays(camera_at({0, 0, 0}, {2, 0, 0}, {0, 0, 1}, 90), 2, 2, &pixels);
    expect_direction(ray_of_pixel(rays, pixels, 0), 1, 0.5, 0.5);
    expect_direction(ray_of_pixel(rays, pixels, 1), 1, -0.5, 0.5);
    expect_direction(ray_of_pixel(rays, pixels, 3), 1, -0.5, -0.5);
}

TEST(PrimaryRays, UpNeedNotBeAtRightAngles) {
    std::vector<std::uint32_t> pixels;
    const auto rays =
        make_primary_rays(camera_at({0, 0, 0}, {0, 0, -1}, {0, 1, -0.9f}, 90), 1, 1, &pixels);
    expect_direction(rays[0], 0, 0, -1);
}

TEST(PrimaryRays, FollowTheMortonOrder) {
    std::vector<std::uint32_t> pixels;
    const auto rays = make_primary_rays(Camera{}, 4, 4, &pixels);
    EXPECT_EQ(pixels[2], 4u);
    EXPECT_GT(rays[0].direction.y, rays[2].direction.y);  // down one row
    EXPECT_LT(rays[2].direction.x, 0.0f);
}

TEST(PrimaryRays, DegenerateCamerasAreNamed) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const std::pair<Camera, std::string> cases[] = {
        {camera_at({1, 1, 1}, {1, 1, 1}, {0, 1, 0}, 45), "position equals target"},
        {camera_at({0, 0, 0}, {0, 3, 0}, {0, -1, 0}, 45), "up is parallel to the view"},
        {camera_at({0, 0, 0}, {0, 0, 1}, {0, 0, 0}, 45), "up is zero"},
        {camera_at({nan, 0, 0}, {0, 0, 1}, {0, 1, 0}, 45), "position is not finite"},
        {camera_at({0, 0, 0}, {0, 0, infinity}, {0, 1, 0}, 45), "target is not finite"},
        {camera_at({0, 0, 0}, {0, 0, 1}, {0, nan, 0}, 45), "up is not finite"},
        {camera_at({0, 0, 0}, {0, 0, 1}, {0, 1, 0}, 0), "vfov"},
        {camera_at({0, 0, 0}, {0, 0, 1}, {0, 1, 0}, 180), "vfov"},
        {camera_at({0, 0, 0}, {0, 0, 1}, {0, 1, 0}, nan), "vfov"}};
    for (const auto& [camera, reason] : cases) {
        try {
            (void)make_primary_rays(camera, 8, 8);
            ADD_FAILURE() << "no error: " << reason;
        } catch (const InputError& error) {
            EXPECT_NE(std::string(error.what()).find("camera 'test'"), std::string::npos);
            EXPECT_NE(std::string(error.what()).find(reason), std::string::npos) << error.what();
        }
    }
    EXPECT_THROW((void)make_primary_rays(Camera{}, 0, 8), InputError);
    EXPECT_THROW((void)make_primary_rays(Camera{}, 8, 16385), InputError);
}

/// Every corner of the box lies on a screen as high as it is wide, and one of them near its edge.
void expect_fits(const Aabb& box, float vfov) {
    const CameraFrame frame = make_camera_frame(fit_camera(box, vfov), 100, 100);
    double farthest = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
        const Double3 p(corner & 1 ? box.hi.x : box.lo.x, corner & 2 ? box.hi.y : box.lo.y,
                        corner & 4 ? box.hi.z : box.lo.z);
        const Double3 d = p - Double3(frame.position);
        const double depth = dot(d, frame.forward);
        ASSERT_GT(depth, 0.0);
        const double across = dot(d, frame.right) / dot(frame.right, frame.right) / depth;
        const double above = dot(d, frame.up) / dot(frame.up, frame.up) / depth;
        farthest = std::max({farthest, std::abs(across), std::abs(above)});
    }
    EXPECT_LE(farthest, 1.0);
    EXPECT_GE(farthest, 0.75);
}

TEST(FitCamera, SeesTheWholeBox) {
    for (const float vfov : {10.0f, 45.0f, 120.0f}) {
        expect_fits({{0, 0, 0}, {1, 1, 1}}, vfov);
        expect_fits({{-100, 3, 5}, {900, 4, 6}}, vfov);
        expect_fits({{-1e-3f, -2, 0}, {1e-3f, 40, 0}}, vfov);
        expect_fits({{-1e9f, -1e9f, -1e9f}, {1e9f, 1e9f, 1e9f}}, vfov);
    }
}

TEST(FitCamera, PointsAndEmptyBoxesGiveUsableCameras) {
    const Aabb boxes[] = {{{1, 2, 3}, {1, 2, 3}},
                          {{1e12f, 1e12f, 1e12f}, {1e12f, 1e12f, 1e12f}},
                          {{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}}};
    for (const Aabb& box : boxes) EXPECT_EQ(make_primary_rays(fit_camera(box), 2, 2).size(), 4u);
    EXPECT_THROW((void)fit_camera(boxes[0], 0.0f), InputError);
    EXPECT_THROW((void)fit_camera(boxes[0], 180.0f), InputError);
}

}  // namespace
}  // namespace raydix
