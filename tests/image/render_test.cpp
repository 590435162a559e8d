// src/image/render.cpp: what each view shows, and golden pictures of all of them.
#include <raydix/error.h>
#include <raydix/picture.h>
#include <raydix/rays.h>
#include <raydix/trace.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>

#include "build/shapes.h"
#include "image/pictures.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix {
namespace {

using test::all_views, test::camera_before_ball, test::count_different, test::options_for,
    test::same_pixels;

Vec3 at(const Picture& picture, std::uint32_t x, std::uint32_t y) {
    return picture.pixels[std::size_t{y} * picture.width + x];
}

/// A ball of radius 1 about the origin, seen from +z.
Picture ball_picture(View view, RenderOptions options = {}) {
    Mesh mesh;
    test::add_sphere(mesh, {0, 0, 0}, 1.0f, 64);
    options.view = view;
    options.width = options.height = 65;
    return render(build_bvh(mesh), {"ball", {0, 0, 4}, {0, 0, 0}, {0, 1, 0}, 40}, options);
}

TEST(RenderNormal, PointsTowardTheViewerLeftIsLeftUpIsUp) {
    const Picture picture = ball_picture(View::normal);
    const Vec3 middle = at(picture, 32, 32), left = at(picture, 14, 32), top = at(picture, 32, 14);
    EXPECT_NEAR(middle.x, 0.5f, 0.03f);
    EXPECT_NEAR(middle.y, 0.5f, 0.03f);
    EXPECT_NEAR(middle.z, 1.0f, 0.01f);
    EXPECT_LT(left.x, 0.25f);
    EXPECT_NEAR(left.y, 0.5f, 0.05f);
    EXPECT_GT(top.y, 0.75f);
    EXPECT_GT(at(picture, 50, 32).x, 0.75f);
    EXPECT_EQ(at(picture, 0, 0).x, 0.0f);
}

TEST(RenderDepth, NearWhiteFarDarkNothingBlack) {
    Mesh mesh;
    test::add_quad(mesh, {-1, -1, 0}, {0, -1, 0}, {0, 1, 0}, {-1, 1, 0});
    test::add_quad(mesh, {0, -1, -2}, {1, -1, -2}, {1, 1, -2}, {0, 1, -2});
    test::add_quad(mesh, {-0.2f, -0.2f, 1}, {0.2f, -0.2f, 1}, {0.2f, 0.2f, 1}, {-0.2f, 0.2f, 1});
    const Picture picture = render(build_bvh(mesh), {"", {0, 0, 3}, {0, 0, 0}, {0, 1, 0}, 60},
                                   options_for(View::depth, 65, 65));
    // Distances along the view: 2 (near), 3 and 5 (far).
    EXPECT_NEAR(at(picture, 32, 32).x, 1.0f, 1e-6f);
    EXPECT_NEAR(at(picture, 22, 32).x, 0.7f, 1e-6f);
    EXPECT_NEAR(at(picture, 14, 24).x, 0.7f, 1e-6f);
    EXPECT_NEAR(at(picture, 40, 32).x, 0.1f, 1e-6f);
    EXPECT_EQ(at(picture, 1, 1).x, 0.0f);
}

TEST(RenderAo, FlatIsOpenInsideIsClosed) {
    Mesh floor;
    test::add_quad(floor, {-9, 0, -9}, {-9, 0, 9}, {9, 0, 9}, {9, 0, -9});
    const Camera above{"", {0, 5, 5}, {0, 0, 0}, {0, 1, 0}, 40};
    const Picture open = render(build_bvh(floor), above, options_for(View::ao));
    for (const Vec3& p : open.pixels) ASSERT_EQ(p.x, 1.0f);

    Mesh room;
    test::add_box(room, {-10, -1, -10}, {10, 9, 10});
    RenderOptions options = options_for(View::ao);
    options.ao_radius = 100.0f;
    const Picture closed = render(build_bvh(room), above, options);
    for (const Vec3& p : closed.pixels) ASSERT_EQ(p.x, 0.0f);

    // At the foot of an endless wall half of the cosine-weighted sky is gone.
    Mesh corner = floor;
    test::add_quad(corner, {-900, -900, -1}, {900, -900, -1}, {900, 900, -1}, {-900, 900, -1});
    options.ao_radius = 1000.0f;
    options.samples = 256;
    const Camera near_wall{"", {0, 1, 0}, {0, 0, -0.999f}, {0, 1, 0}, 0.01f};
    const Picture half = render(build_bvh(corner), near_wall, options);
    double mean = 0;
    for (const Vec3& p : half.pixels) mean += p.x / static_cast<double>(half.pixels.size());
    EXPECT_NEAR(mean, 0.5, 0.01);
}

TEST(RenderPrimitive, OneColourPerTriangle) {
    Mesh mesh;
    test::add_quad(mesh, {-9, -9, 0}, {9, -9, 0}, {9, 9, 0}, {-9, 9, 0});
    const Picture picture = render(build_bvh(mesh), {"", {0, 0, 3}, {0, 0, 0}, {0, 1, 0}, 60},
                                   options_for(View::primitive));
    // Triangle 0 lies to the lower right of the diagonal, triangle 1 to the upper left.
    const Vec3 lower = at(picture, 50, 40), upper = at(picture, 10, 5);
    EXPECT_NE(lower.x, upper.x);
    for (const Vec3& p : picture.pixels) EXPECT_TRUE(p.x == lower.x || p.x == upper.x);
}

TEST(RenderShaded, LightComesFromAboveLeftAndShadowsFall) {
    const Picture ball = ball_picture(View::shaded);
    EXPECT_GT(at(ball, 22, 22).y, 1.5f * at(ball, 42, 44).y);
    Mesh mesh;
    test::add_quad(mesh, {-9, 0, -9}, {-9, 0, 9}, {9, 0, 9}, {9, 0, -9});
    const Camera camera{"", {0, 8, 8}, {0, 0, 0}, {0, 1, 0}, 40};
    const float lit = at(render(build_bvh(mesh), camera, options_for(View::shaded)), 32, 24).y;
    // A roof toward the sun, out of the picture.
    test::add_quad(mesh, {-26, 20, -10}, {-26, 20, 30}, {-6, 20, 30}, {-6, 20, -10});
    const float shadowed = at(render(build_bvh(mesh), camera, options_for(View::shaded)), 32, 24).y;
    EXPECT_LT(shadowed, 0.7f * lit);
    EXPECT_GT(shadowed, 0.1f * lit);
}

TEST(RenderDiffuse, WallsThrowLightOnEachOther) {
    // A lamp in the middle of a closed room. In a cube all walls face it; between two endless walls
    // 2 apart most of what a wall sees of the other is lit at a slant (mean cosine 0.47, not 0.7).
    const auto middle_of_wall = [](float half_width) {
        Mesh room;
        test::add_box(room, {-half_width, -half_width, -1}, {half_width, half_width, 1});
        const Camera camera{"", {0, 0, 0}, {0, 0, -1}, {0, 1, 0}, 5};
        RenderOptions options = options_for(View::diffuse, 8, 8);
        options.samples = 512;
        return at(render(build_bvh(room), camera, options), 4, 4).x;
    };
    const float cube = middle_of_wall(1.0f), endless = middle_of_wall(1000.0f);
    EXPECT_GT(cube, 1.05f * endless);
    EXPECT_LT(cube, 1.20f * endless);
}

TEST(RenderPath, LightOfAWhiteBallIsASeries) {
    // Inside a ball with the lamp in its middle all walls have the same light L from it, and look
    // at nothing but each other: grey (L + grey (L + ...)), here with eight bounces.
    Mesh ball;
    test::add_sphere(ball, {0, 0, 0}, 1.0f, 64);
    const Camera camera{"", {0, 0, 0}, {0, 0, -1}, {0, 1, 0}, 60};
    RenderOptions options = options_for(View::path, 8, 8);
    options.samples = 64;
    const Picture picture = render(build_bvh(ball), camera, options);
    const double grey = 0.72, lamp = 0.58;  // of the red channel: render_light.cpp
    double expected = 0, part = 1;
    for (int bounce = 0; bounce <= 8; ++bounce) expected += lamp * (part *= grey);
    for (const Vec3& pixel : picture.pixels) EXPECT_NEAR(pixel.x, expected, 0.01 * expected);
}

TEST(RenderPath, FewSamplesAreRightInTheMean) {
    // A wall on a floor under the sky: one path a pixel, over many pixels and seeds, against many.
    const Bvh bvh = build_bvh(test::ball_and_boxes());
    const auto mean = [&](int samples, int seeds) {
        double sum = 0;
        for (int seed = 1; seed <= seeds; ++seed) {
            RenderOptions options = options_for(View::path, 48, 36);
            options.samples = samples;
            options.seed = static_cast<std::uint64_t>(seed);
            for (const Vec3& pixel : render(bvh, camera_before_ball(), options).pixels)
                sum += pixel.y;
        }
        return sum / seeds;
    };
    const double many = mean(512, 1);
    EXPECT_NEAR(mean(4, 24), many, 0.004 * many);
}

TEST(RenderPath, IsAboutAsBrightAsOneBounceInTheOpen) {
    // There `diffuse` has a constant for all further bounces, and most light comes from the sky.
    const Bvh bvh = build_bvh(test::ball_and_boxes());
    RenderOptions options = options_for(View::path, 32, 24);
    options.samples = 256;
    const Picture path = render(bvh, camera_before_ball(), options);
    options.view = View::diffuse;
    const Picture diffuse = render(bvh, camera_before_ball(), options);
    EXPECT_EQ(at(path, 0, 0).z, at(diffuse, 0, 0).z);  // sky
    double difference = 0, light = 0;
    for (std::size_t i = 0; i < path.pixels.size(); ++i)
        difference += path.pixels[i].y - diffuse.pixels[i].y, light += diffuse.pixels[i].y;
    EXPECT_LT(std::abs(difference), 0.1 * light);
}

TEST(RenderSteps, MissesAreDarkHitsAreLighter) {
    const Picture picture = ball_picture(View::steps);
    const auto light = [](Vec3 p) { return p.x + p.y + p.z; };
    EXPECT_LT(light(at(picture, 0, 0)), light(at(picture, 32, 32)));
}

TEST(Render, IsTheSameForEveryThreadCount) {
    const Bvh bvh = build_bvh(test::ball_and_boxes());
    for (const View view : all_views) {
        RenderOptions options = options_for(view, 61, 37);
        options.samples = 9;
        options.threads = 1;
        const Picture one = render(bvh, camera_before_ball(), options);
        for (const int threads : {2, 7}) {
            options.threads = threads;
            const Picture many = render(bvh, camera_before_ball(), options);
            ASSERT_EQ(one.pixels.size(), many.pixels.size());
            EXPECT_TRUE(same_pixels(one, many)) << view_name(view);
        }
    }
}

TEST(Render, ReportsProgressUpToOne) {
    RenderOptions options = options_for(View::ao, 128, 128);
    options.samples = 256;
    std::vector<double> parts;
    options.progress = [&](double part) { parts.push_back(part); };
    (void)render(build_bvh(test::ball_and_boxes()), camera_before_ball(), options);
    ASSERT_GT(parts.size(), 2u);
    EXPECT_TRUE(std::is_sorted(parts.begin(), parts.end()));
    EXPECT_EQ(parts.back(), 1.0);
}

TEST(Render, ProgressMayThrowAndMayTrace) {
    const Bvh bvh = build_bvh(test::ball_and_boxes());
    RenderOptions options = options_for(View::ao, 128, 128);
    options.samples = test::sanitized ? 16 : 256;
    int calls = 0;
    options.progress = [&](double) {
        ++calls;
        throw std::runtime_error("enough");
    };
    EXPECT_THROW((void)render(bvh, camera_before_ball(), options), std::runtime_error);
    EXPECT_EQ(calls, 1);
    const std::vector<Ray> rays = make_primary_rays(camera_before_ball(), 64, 64);
    options.progress = [&](double) { calls += trace(bvh, rays).size() == rays.size(); };
    (void)render(bvh, camera_before_ball(), options);
    EXPECT_GT(calls, 2);
}

TEST(Render, EmptyTreesShowTheBackground) {
    for (const View view : all_views) {
        const Picture picture = render(build_bvh(Mesh{}), camera_before_ball(), options_for(view));
        ASSERT_EQ(picture.pixels.size(), 64u * 48u);
        for (const Vec3& p : picture.pixels) ASSERT_TRUE(std::isfinite(p.x + p.y + p.z));
    }
    const Picture sky = render(build_bvh(Mesh{}), camera_before_ball(), options_for(View::shaded));
    EXPECT_GT(at(sky, 5, 0).z, at(sky, 5, 0).x);
    EXPECT_EQ(render(build_bvh(Mesh{}), camera_before_ball(), options_for(View::ao)).pixels[0].x,
              1.0f);
}

TEST(Render, RefusesWhatItCannotShow) {
    const Bvh bvh = build_bvh(test::ball_and_boxes());
    const std::vector<Vec3> points{{0, 0, 0}, {1, 1, 1}};
    EXPECT_THROW((void)render(build_bvh(points), camera_before_ball()), InputError);
    RenderOptions options = options_for(View::ao);
    options.samples = -1;
    EXPECT_THROW((void)render(bvh, camera_before_ball(), options), InputError);
    options.samples = 4097;
    EXPECT_THROW((void)render(bvh, camera_before_ball(), options), InputError);
    options.samples = 1;
    options.ao_radius = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW((void)render(bvh, camera_before_ball(), options), InputError);
    EXPECT_THROW((void)render(bvh, camera_before_ball(), options_for(View::normal, 0, 5)),
                 InputError);
    Camera camera = camera_before_ball();
    camera.target = camera.position;
    EXPECT_THROW((void)render(bvh, camera, options_for(View::normal)), InputError);
}

TEST(ViewNames, GoThereAndBack) {
    for (const View view : all_views) EXPECT_EQ(view_from_name(view_name(view)), view);
    try {
        (void)view_from_name("x-ray");
        ADD_FAILURE();
    } catch (const InputError& error) {
        EXPECT_STREQ(
            error.what(),
            "unknown view 'x-ray'; known: shaded normal depth primitive ao diffuse steps path");
    }
}

/// RAYDIX_UPDATE_GOLDEN=1 writes the pictures anew: look at them before they are committed.
TEST(Render, GoldenPictures) {
    const std::filesystem::path folder = test::source_file("tests/golden");
    const char* const update = std::getenv("RAYDIX_UPDATE_GOLDEN");
    const test::TempFolder scratch;
    const Bvh bvh = build_bvh(test::ball_and_boxes());
    for (const View view : all_views) {
        SCOPED_TRACE(view_name(view));
        const std::string name = std::string(view_name(view)) + ".png";
        const bool tone_map = is_tone_mapped(view);
        RenderOptions options = options_for(view, 256, 192);
        if (view == View::ao) options.ao_radius = 2.5f;
        const Picture picture = render(bvh, camera_before_ball(), options);
        if (update && std::string_view(update) == "1")
            save_picture(folder / name, picture, tone_map);
        save_picture(scratch.path() / name, picture, tone_map);
        const Picture now = load_picture(scratch.path() / name),
                      golden = load_picture(folder / name);
        ASSERT_EQ(now.width, golden.width);
        ASSERT_EQ(now.height, golden.height);
        EXPECT_LE(count_different(now, golden), now.pixels.size() / 1000);
    }
}

}  // namespace
}  // namespace raydix
