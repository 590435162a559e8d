// render and make_secondary_rays of scenes, beside those of one tree over the same triangles.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/picture.h>
#include <raydix/rays.h>
#include <raydix/surface.h>
#include <raydix/trace.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <tuple>
#include <vector>

#include "base/double3.h"
#include "build/shapes.h"
#include "engine/affine.h"
#include "image/pictures.h"
#include "support/message.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix {
namespace {

using test::all_views, test::camera_before_ball, test::count_different, test::options_for,
    test::same_pixels;

/// A mesh with -0, a corner that is not finite, and triangles without area beyond all others.
Mesh awkward_mesh() {
    Mesh mesh = test::ball_and_boxes();
    for (Vec3& p : mesh.vertices)
        for (float* const x : {&p.x, &p.y, &p.z})
            if (*x == 0) *x = -0.0f;
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    const float nan = std::numeric_limits<float>::quiet_NaN();
    mesh.vertices.insert(mesh.vertices.end(), {{50, 0, 0}, {60, 0, 0}, {nan, 0, 0}});
    mesh.triangles.push_back({first, first + 1, first});
    mesh.triangles.push_back({first, first + 1, first + 2});
    return mesh;
}

/// Parts of a mesh, in order.
std::vector<Mesh> parts_of(const Mesh& mesh, std::size_t count) {
    std::vector<Mesh> parts(count);
    for (std::size_t p = 0; p < count; ++p) {
        parts[p].vertices = mesh.vertices;
        for (std::size_t i = mesh.triangles.size() * p / count;
             i < mesh.triangles.size() * (p + 1) / count; ++i)
            parts[p].triangles.push_back(mesh.triangles[i]);
    }
    return parts;
}

TEST(RenderScene, OneMeshIsTheSamePictureAsItsTree) {
    const Mesh meshes[] = {test::ball_and_boxes(), awkward_mesh(),
                           test::random_soup(test::fewer(20'000, 10), 3), Mesh{}};
    for (const Mesh& mesh : meshes) {
        const Bvh bvh = build_bvh(mesh);
        for (const SceneOptions& how :
             {SceneOptions{}, SceneOptions{.quality = Quality::high},
              SceneOptions{.quality = Quality::fast, .usage = Usage::moving},
              SceneOptions{.compact = true}}) {
            const Scene scene(mesh, how);
            for (const View view : all_views) {
                if (view == View::steps) continue;
                const RenderOptions options =
                    test::sanitized ? options_for(view, 29, 19) : options_for(view, 61, 37);
                EXPECT_TRUE(same_pixels(render(scene, camera_before_ball(), options),
                                        render(bvh, camera_before_ball(), options)))
                    << view_name(view) << " of " << mesh.triangles.size() << " triangles";
            }
        }
    }
}

/// Only colours of triangles say that there are several.
TEST(RenderScene, SeveralMeshesAreThePictureOfAll) {
    const Mesh mesh = test::ball_and_boxes();
    const Bvh bvh = build_bvh(mesh);
    for (const Usage usage : {Usage::fixed, Usage::moving}) {
        Scene scene;
        for (const Mesh& part : parts_of(mesh, 7)) scene.add(part);
        scene.commit({.usage = usage});
        for (const View view : {View::shaded, View::normal, View::depth, View::ao, View::diffuse})
            EXPECT_TRUE(same_pixels(render(scene, camera_before_ball(), options_for(view)),
                                    render(bvh, camera_before_ball(), options_for(view))))
                << view_name(view);
    }
}

Transform transform_of(float ax, float ay, float az, Vec3 move, float shear = 0) {
    Transform t;
    t.m = {{{ax, shear, 0, move.x}, {0, ay, 0, move.y}, {0, 0, az, move.z}}};
    return t;
}

/// `mesh` as an instance shows it.
Mesh moved(const Mesh& mesh, const Transform& transform) {
    Mesh out = mesh;
    for (Vec3& p : out.vertices) p = affine_of(transform).point(Double3(p)).rounded();
    return out;
}

void append(Mesh& mesh, const Mesh& other) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), other.vertices.begin(), other.vertices.end());
    for (const Triangle& t : other.triangles)
        mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

/// A floor, and boxes on it: mirrored, sheared, instances of an instance, one masked away.
struct Boxes {
    Scene scene, group, box;
    Mesh flat, mesh;

    Boxes() {
        test::add_box(mesh, {-0.5f, 0, -0.5f}, {0.5f, 1, 0.5f});
        box.add(mesh);
        box.commit();
        const Transform mirrored = transform_of(-1, 2, 1, {-1.5f, 0, 0.3f}),
                        sheared = transform_of(1, 1, 0.5f, {1, 0, 1}, 0.7f),
                        small = transform_of(0.5f, 0.5f, -0.5f, {0, 1.2f, 0});
        group.add(box, mirrored);
        group.add(box, sheared);
        group.commit();
        test::add_quad(flat, {-4, 0, -4}, {-4, 0, 4}, {4, 0, 4}, {4, 0, -4});
        scene.add(flat);
        scene.add(group, Transform{});
        scene.add(group, small);
        scene.add(box, Transform{}, {.mask = 0});
        scene.commit();
        for (const Transform& one : {mirrored, sheared}) {
            append(flat, moved(mesh, one));
            append(flat, moved(moved(mesh, one), small));
        }
    }
};

TEST(RenderScene, InstancesStandInTheWorld) {
    const Boxes boxes;
    const Bvh bvh = build_bvh(boxes.flat);
    for (const View view : {View::shaded, View::normal, View::depth, View::ao, View::diffuse}) {
        const RenderOptions options = options_for(view, 128, 96);
        const Picture picture = render(boxes.scene, camera_before_ball(), options),
                      wanted = render(bvh, camera_before_ball(), options);
        EXPECT_LE(count_different(picture, wanted), picture.pixels.size() / 100) << view_name(view);
        EXPECT_GT(
            count_different(picture, render(build_bvh(boxes.mesh), camera_before_ball(), options)),
            picture.pixels.size() / 20);
    }
}

TEST(RenderScene, EachTriangleOfEachInstanceHasAColour) {
    Mesh floor;
    test::add_quad(floor, {-4, 0, -4}, {-4, 0, 4}, {4, 0, 4}, {4, 0, -4});
    Mesh box;
    test::add_box(box, {-0.2f, 0, -0.2f}, {0.2f, 0.4f, 0.2f});
    Scene inner, scene;
    inner.add(box);
    inner.add(moved(box, transform_of(1, 1, 1, {0.5f, 0, 0})));
    inner.commit();
    scene.add(floor);
    scene.add(moved(box, transform_of(1, 1, 1, {0, 0, -2})));
    for (const float x : {-2.0f, -0.5f, 1.0f}) scene.add(inner, transform_of(1, 1, 1, {x, 0, 0}));
    scene.commit();
    const RenderOptions options = options_for(View::primitive, 256, 192);
    const Picture picture = render(scene, camera_before_ball(), options);
    std::vector<std::uint32_t> pixels;
    const std::vector<Ray> rays = make_primary_rays(camera_before_ball(), 256, 192, &pixels);
    const std::vector<Hit> hits = trace(scene, rays);
    using Colour = std::tuple<float, float, float>;
    using Name = std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>;
    std::map<Colour, Name> names;
    std::map<Name, Colour> colours;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const Vec3 p = picture.pixels[pixels[i]];
        const Name name = hits[i].hit() ? Name{hits[i].instance, hits[i].geometry, hits[i].prim}
                                        : Name{no_primitive, no_primitive, no_primitive};
        EXPECT_EQ(names.emplace(Colour{p.x, p.y, p.z}, name).first->second, name);
        EXPECT_EQ(colours.emplace(name, Colour{p.x, p.y, p.z}).first->second,
                  (Colour{p.x, p.y, p.z}));
    }
    EXPECT_GT(names.size(), 25u);
}

TEST(RenderScene, StepsAreLighterWhereThereIsMore) {
    const Boxes boxes;
    Scene several;
    for (const Mesh& part : parts_of(test::ball_and_boxes(), 5)) several.add(part);
    several.commit({.usage = Usage::moving});
    const Scene one(test::ball_and_boxes());
    std::vector<std::uint32_t> pixels;
    const std::vector<Ray> rays = make_primary_rays(camera_before_ball(), 65, 65, &pixels);
    for (const Scene* const scene :
         std::initializer_list<const Scene*>{&boxes.scene, &several, &one}) {
        const Picture picture =
            render(*scene, camera_before_ball(), options_for(View::steps, 65, 65));
        const std::vector<Hit> hits = trace(*scene, rays);
        double light[2] = {0, 0}, count[2] = {0, 0};  // of misses and of hits
        for (std::size_t i = 0; i < rays.size(); ++i) {
            const Vec3 p = picture.pixels[pixels[i]];
            light[hits[i].hit()] += p.x + p.y + p.z;
            ++count[hits[i].hit()];
        }
        EXPECT_GT(light[1] / count[1], 1.5 * light[0] / count[0]);
    }
}

TEST(RenderScene, IsTheSameForEveryThreadCount) {
    const Boxes boxes;
    for (const View view : all_views) {
        RenderOptions options = options_for(view, 61, 37);
        options.samples = 9;
        options.threads = 1;
        const Picture one = render(boxes.scene, camera_before_ball(), options);
        for (const int threads : {2, 7}) {
            options.threads = threads;
            EXPECT_TRUE(same_pixels(one, render(boxes.scene, camera_before_ball(), options)))
                << view_name(view);
        }
    }
}

TEST(RenderScene, WhatCannotBeSeenIsNotThere) {
    Scene masked, empty, nothing_inside, inner;
    masked.add(test::ball_and_boxes(), {.mask = 0});
    masked.commit();
    empty.commit();
    inner.commit();
    nothing_inside.add(inner, Transform{});
    nothing_inside.commit();
    for (const View view : all_views) {
        const Picture sky = render(build_bvh(Mesh{}), camera_before_ball(), options_for(view));
        for (const Scene* const scene :
             std::initializer_list<const Scene*>{&masked, &empty, &nothing_inside})
            EXPECT_TRUE(same_pixels(render(*scene, camera_before_ball(), options_for(view)), sky))
                << view_name(view);
    }
}

TEST(RenderScene, ShowsTheLastCommit) {
    const Mesh mesh = test::ball_and_boxes();
    Scene scene(mesh);
    const Picture before = render(scene, camera_before_ball(), options_for(View::shaded));
    scene.update(0, moved(mesh, transform_of(1, 0.5f, 1, {0.2f, 0, 0})));
    EXPECT_TRUE(
        same_pixels(render(scene, camera_before_ball(), options_for(View::shaded)), before));
    scene.commit();
    EXPECT_GT(
        count_different(render(scene, camera_before_ball(), options_for(View::shaded)), before),
        before.pixels.size() / 20);
}

TEST(RenderScene, ProgressMayTraceTheSameScene) {
    const Boxes boxes;
    RenderOptions options = options_for(View::ao, 128, 128);
    options.samples = test::sanitized ? 16 : 256;
    const Picture quiet = render(boxes.scene, camera_before_ball(), options);
    const std::vector<Ray> rays = make_primary_rays(camera_before_ball(), 64, 64);
    std::size_t calls = 0;
    double last = 0;
    options.progress = [&](double part) {
        calls += trace(boxes.scene, rays).size() == rays.size();
        last = part;
    };
    EXPECT_TRUE(same_pixels(render(boxes.scene, camera_before_ball(), options), quiet));
    EXPECT_GT(calls, 2u);
    EXPECT_EQ(last, 1.0);
}

TEST(RenderScene, RefusesWhatItCannotShow) {
    EXPECT_EQ(test::message_of([] { (void)render(Scene(), camera_before_ball()); }),
              "scene: it was never committed");
    const Scene scene(test::ball_and_boxes());
    RenderOptions options = options_for(View::ao);
    options.samples = 4097;
    EXPECT_THROW((void)render(scene, camera_before_ball(), options), InputError);
    options.samples = 1;
    options.ao_radius = -1;
    EXPECT_THROW((void)render(scene, camera_before_ball(), options), InputError);
    EXPECT_THROW((void)render(scene, camera_before_ball(), options_for(View::normal, 0, 5)),
                 InputError);
}

/// Hits of the camera's rays.
struct Seen {
    explicit Seen(const Scene& scene) : hits(trace(scene, rays)) {}
    std::vector<std::uint32_t> pixels;
    std::vector<Ray> rays = make_primary_rays(camera_before_ball(), 48, 36, &pixels);
    std::vector<Hit> hits;
};

TEST(SecondaryRaysOfScenes, OfOneMeshAreThoseOfItsTree) {
    for (const Mesh& mesh : {test::ball_and_boxes(), awkward_mesh(), test::random_soup(5000, 8)}) {
        const Bvh bvh = build_bvh(mesh);
        for (const SceneOptions& how : {SceneOptions{}, SceneOptions{.compact = true}}) {
            const Scene scene(mesh, how);
            const Seen seen(scene);
            for (const RayKind kind : {RayKind::ao, RayKind::diffuse, RayKind::diffuse_shuffled}) {
                const SecondaryOptions options{.kind = kind, .samples = 5, .seed = 7};
                const auto of_scene =
                    make_secondary_rays(scene, seen.rays, seen.hits, seen.pixels, options);
                const auto of_tree = make_secondary_rays(bvh, seen.rays, trace(bvh, seen.rays),
                                                         seen.pixels, options);
                ASSERT_GT(of_tree.size(), 100u);
                ASSERT_EQ(of_scene.size(), of_tree.size());
                EXPECT_EQ(
                    std::memcmp(of_scene.data(), of_tree.data(), of_tree.size() * sizeof(Ray)), 0);
            }
        }
    }
}

TEST(SecondaryRaysOfScenes, LeaveTheSurfacesOfInstances) {
    const Boxes boxes;
    const Seen seen(boxes.scene);
    constexpr int samples = 8;
    const auto rays =
        make_secondary_rays(boxes.scene, seen.rays, seen.hits, seen.pixels,
                            {.kind = RayKind::diffuse, .samples = samples, .sorted = false});
    const std::vector<Vec3> ways = normals(boxes.scene, seen.hits),
                            points = positions(boxes.scene, seen.hits);
    std::size_t next = 0, on_instances = 0;
    for (std::size_t i = 0; i < seen.hits.size(); ++i) {
        if (!seen.hits[i].hit()) continue;
        on_instances += seen.hits[i].instance != 0;
        const double side = dot(Double3(ways[i]), Double3(seen.rays[i].direction));
        for (int k = 0; k < samples; ++k, ++next) {
            EXPECT_LT(side * dot(Double3(rays[next].direction), Double3(ways[i])), 0);
            EXPECT_LT(length(Double3(rays[next].origin) - Double3(points[i])), 1e-4);
        }
    }
    EXPECT_EQ(next, rays.size());
    EXPECT_GT(on_instances, 100u);
}

TEST(SecondaryRaysOfScenes, RefuseHitsOfOtherScenes) {
    const Boxes boxes;
    Seen seen(boxes.scene);
    const auto message = [&](const Scene& scene) {
        return test::message_of(
            [&] { (void)make_secondary_rays(scene, seen.rays, seen.hits, seen.pixels, {}); });
    };
    EXPECT_EQ(message(boxes.scene), "no error");
    EXPECT_EQ(message(Scene()), "scene: it was never committed");
    seen.hits[7] = hit_of_tree({1, 0, 0, 0});
    seen.hits[7].instance = 99;
    EXPECT_EQ(message(boxes.scene), "hit 7: the scene has no path 99 of instances");
    seen.hits[7].instance = 0;
    seen.hits[7].prim = 2;
    EXPECT_EQ(message(boxes.scene), "hit 7: mesh 0 has 2 triangles; there is no triangle 2");
    seen.pixels.pop_back();
    EXPECT_NE(message(boxes.scene), "no error");
    EXPECT_TRUE(make_secondary_rays(Scene(Mesh{}), {}, {}, {}, {}).empty());
}

}  // namespace
}  // namespace raydix
