// .rdx files of scenes: a loaded scene has the hits of the one that was saved, shares its pages,
// and goes on as a scene.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/rdx.h>
#include <raydix/shapes.h>
#include <raydix/surface.h>
#include <raydix/user_geometry.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "engine/scene_state.h"
#include "io/rdx_scenes.h"
#include "support/message.h"

namespace raydix::test {
namespace {

Mesh random_mesh(Dice& dice) {
    Mesh mesh = random_soup(1 + dice.below(60), dice.below(1000), 0.6f);
    if (dice.below(3) == 0) mesh.vertices.front() = {-0.0f, 0.5f, -0.0f};
    if (dice.below(4) == 0) mesh.vertices.back().y = std::numeric_limits<float>::quiet_NaN();
    if (dice.below(4) == 0) mesh.triangles.front() = {0, 0, 1};
    return mesh;
}

/// Meshes, empty ones, holes, and two further scenes at several places each.
Scene random_scene(Dice& dice, std::uint32_t levels, const SceneOptions& options) {
    Scene scene;
    std::vector<Scene> inner;
    if (levels > 0)
        for (int k = 0; k < 2; ++k) inner.push_back(random_scene(dice, levels - 1, options));
    for (std::uint32_t k = 0, id = 0; k < 7; ++k, ++id) {
        if (dice.below(4) == 0) id += 1 + static_cast<std::uint32_t>(dice.below(5));
        const GeometryOptions geometry{dice.mask(), id};
        if (!inner.empty() && dice.below(3) != 0)
            scene.add(inner[dice.below(2)], dice.transform(3), geometry);
        else
            scene.add(dice.below(8) == 0 ? Mesh{} : random_mesh(dice), geometry);
    }
    scene.commit(options);
    return scene;
}

bool same_hits(std::span<const Hit> a, std::span<const Hit> b) {
    const auto same = [](const Hit& x, const Hit& y) {
        return std::memcmp(&x.t, &y.t, sizeof(float)) == 0 && x.prim == y.prim && x.u == y.u &&
               x.v == y.v && x.geometry == y.geometry && x.instance == y.instance;
    };
    return std::ranges::equal(a, b, same);
}

std::size_t hits_in(std::span<const Hit> hits) {
    return static_cast<std::size_t>(std::ranges::count_if(hits, &Hit::hit));
}

bool same_points(std::span<const Vec3> a, std::span<const Vec3> b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}

using SurfaceCall = void(const Scene&, std::span<const Ray>, std::span<const Hit>, std::span<Vec3>,
                         int);

/// Every answer that a scene gives.
void expect_same(const Scene& loaded, const Scene& saved, Dice& dice,
                 std::size_t* found = nullptr) {
    const std::vector<Ray> rays = random_rays(dice, 300);
    std::vector<std::uint32_t> masks;
    for (std::size_t i = 0; i < rays.size(); ++i) masks.push_back(dice.mask());
    const std::vector<Hit> expected = trace(saved, rays, {.masks = masks});
    const std::vector<Hit> hits = trace(loaded, rays, {.masks = masks});
    EXPECT_TRUE(same_hits(hits, expected));
    if (found != nullptr) *found += hits_in(expected);
    std::vector<std::uint8_t> expected_any(rays.size()), any(rays.size());
    trace_any(saved, rays, expected_any);
    trace_any(loaded, rays, any);
    EXPECT_EQ(any, expected_any);
    const AllHits expected_all = trace_all(saved, rays), all = trace_all(loaded, rays);
    EXPECT_EQ(all.offsets, expected_all.offsets);
    EXPECT_TRUE(same_hits(all.hits, expected_all.hits));
    const auto points = [&](const Scene& scene, SurfaceCall* of) {
        std::vector<Vec3> out(rays.size());
        of(scene, rays, expected, out, 0);
        return out;
    };
    for (SurfaceCall* const of :
         {static_cast<SurfaceCall*>(&positions), static_cast<SurfaceCall*>(&normals)})
        EXPECT_TRUE(same_points(points(loaded, of), points(saved, of)));
    for (const Hit& hit : expected)
        if (hit.hit()) {
            EXPECT_EQ(loaded.path(hit.instance), saved.path(hit.instance));
        }
    EXPECT_EQ(loaded.size(), saved.size());
    const Aabb bounds = loaded.bounds(), expected_bounds = saved.bounds();
    EXPECT_EQ(std::memcmp(&bounds, &expected_bounds, sizeof(Aabb)), 0);
}

TEST_F(RdxSceneTest, LoadedScenesHaveTheSameHits) {
    std::size_t found = 0;
    for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high})
        for (const Usage usage : {Usage::fixed, Usage::moving})
            for (const bool compact : {false, true})
                for (std::uint32_t levels = 0; levels < 4; ++levels) {
                    Dice dice(levels + 10 * static_cast<std::uint64_t>(quality));
                    const SceneOptions options{
                        .quality = quality, .usage = usage, .compact = compact};
                    const Scene scene = random_scene(dice, levels, options);
                    save_rdx(file(), scene, "a scene", cameras_);
                    EXPECT_TRUE(holds_scene(file()));
                    const RdxScene loaded = load_rdx_scene(file());
                    EXPECT_TRUE(loaded.scene.committed());
                    EXPECT_EQ(loaded.name, "a scene");
                    ASSERT_EQ(loaded.cameras.cameras.size(), 2u);
                    EXPECT_EQ(loaded.cameras.cameras[0].name, "front \xff");
                    EXPECT_EQ(loaded.cameras.cameras[0].vfov, 30.0f);
                    EXPECT_EQ(loaded.cameras.height, 480u);
                    EXPECT_EQ(loaded.cameras.ao_radius, 0.5f);
                    expect_same(loaded.scene, scene, dice, &found);
                    // Nothing is lost on the way back.
                    const Bytes once = read_bytes(file());
                    save_rdx(file(), loaded.scene, loaded.name, loaded.cameras);
                    EXPECT_EQ(read_bytes(file()), once);
                }
    EXPECT_GT(found, 2000u);
}

TEST_F(RdxSceneTest, SmallScenes) {
    const auto round_trip = [&](const Scene& scene) {
        Dice dice(3);
        save_rdx(file(), scene);
        expect_same(load_rdx_scene(file()).scene, scene, dice);
    };
    Scene empty;
    empty.commit();
    round_trip(empty);
    Scene shows_nothing;
    shows_nothing.add(empty, {}, {.mask = 5, .id = 9});
    shows_nothing.add(Mesh{}, {.mask = 3, .id = {}});
    shows_nothing.commit();
    round_trip(shows_nothing);
    Mesh flat;  // triangles, but none that rays hit
    flat.vertices = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
    flat.triangles = {{0, 1, 2}, {0, 0, 1}};
    for (const bool compact : {false, true}) {
        round_trip(Scene(flat, {.compact = compact}));
        round_trip(Scene(random_soup(1, 4), {.compact = compact}));
        round_trip(Scene(random_soup(2, 5), {.compact = compact}));
    }
    Mesh huge = random_soup(20, 6);
    for (Vec3& v : huge.vertices) v = {v.x * 1e12f, v.y * 1e12f, v.z * 1e12f};
    for (const bool compact : {false, true}) round_trip(Scene(huge, {.compact = compact}));
}

std::uint32_t version_of_file(const Bytes& bytes) {
    rdx::HeaderStart start;
    std::memcpy(&start, bytes.data(), sizeof(start));
    return start.version;
}

TEST_F(RdxSceneTest, ShapesHaveTheSameHits) {
    constexpr float nan = std::numeric_limits<float>::quiet_NaN();
    std::size_t found = 0;
    for (std::uint32_t seed = 0; seed < 12; ++seed) {
        Dice dice(seed);
        const auto fill = [&](Scene& scene) {
            std::vector<Sphere> spheres;
            std::vector<Capsule> capsules;
            std::vector<Vec3> points;
            for (std::uint32_t k = 0; k < 1 + dice.below(40); ++k) {
                spheres.push_back({dice.in(-2, 2), dice.below(5) == 0 ? nan : 0.3f});
                capsules.push_back({dice.in(-2, 2), dice.in(-2, 2), 0.1f});
                points.push_back(dice.in(-2, 2));
            }
            const std::uint32_t id = scene.add(spheres, {dice.mask(), 3 + dice.below(3)});
            scene.add(capsules, {dice.mask(), {}});
            if (dice.below(2) == 0) scene.add(random_mesh(dice), {dice.mask(), {}});
            scene.add(points, 0.2f, {dice.mask(), {}});
            scene.add(std::span<const Sphere>(), {dice.mask(), {}});
            return id;
        };
        const SceneOptions options{.quality = seed % 2 == 0 ? Quality::balanced : Quality::fast,
                                   .usage = seed % 3 == 0 ? Usage::moving : Usage::fixed};
        Scene inner, scene;
        fill(inner);
        inner.commit(options);
        const std::uint32_t id = fill(scene);
        scene.add(inner, dice.transform(2));
        scene.add(inner, dice.transform(2));
        scene.commit(options);
        const Bytes once = saved(scene);
        EXPECT_EQ(version_of_file(once), 3u);
        RdxScene loaded = load_rdx_scene(file());
        EXPECT_EQ(loaded.shape_ids.size(), 4u);
        EXPECT_TRUE(std::ranges::binary_search(loaded.shape_ids, id));
        EXPECT_GE(loaded.counts.shapes, 6u);
        expect_same(loaded.scene, scene, dice, &found);
        save_rdx(file(), loaded.scene, loaded.name, loaded.cameras);
        EXPECT_EQ(read_bytes(file()), once);
        // It goes on as a scene.
        const std::vector<Sphere> moved{{{0.5f, 0, 0}, 1}};
        for (Scene* const each : {&loaded.scene, &scene}) {
            each->update(id, moved);
            each->commit(options);
        }
        expect_same(loaded.scene, scene, dice);
    }
    EXPECT_GT(found, 500u);
    EXPECT_EQ(version_of_file(saved(Scene(random_soup(3, 2)))), 2u);
}

TEST_F(RdxSceneTest, LargerMeshesOfAllQualities) {
    // Long thin triangles, of which quality high makes parts.
    Mesh mesh = random_soup(6000, 12, 0.02f);
    Dice dice(7);
    for (std::size_t i = 0; i < mesh.vertices.size(); i += 60) mesh.vertices[i] = dice.in(-2, 2);
    for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high})
        for (const bool compact : {false, true}) {
            const Scene scene(mesh, {.quality = quality, .compact = compact});
            save_rdx(file(), scene);
            expect_same(load_rdx_scene(file()).scene, scene, dice);
        }
}

TEST_F(RdxSceneTest, TreesAndMeshesLieInTheFile) {
    Scene object(random_soup(500, 3)), scene;
    for (int k = 0; k < 40; ++k) {
        Transform at;
        at.m[0][3] = static_cast<float>(k);
        scene.add(object, at);
    }
    scene.commit();
    const std::uint64_t bytes = saved(scene).size();
    EXPECT_LT(bytes, 500 * (36 + 12 + 60 + 40)) << "the scene inside is there once";
    const RdxScene loaded = load_rdx_scene(file());
    const SceneTree& tree = *SceneInternals::tree(loaded.scene);
    const SceneTree& inner = *tree.instances.front().scene;
    for (const InstanceName& instance : tree.instances)
        EXPECT_EQ(instance.scene.get(), &inner) << "and is one scene when it is loaded";
    const WideBvh::Arrays& arrays = inner.meshes.front()->tree->arrays();
    const auto* const first = reinterpret_cast<const std::byte*>(arrays.nodes.data());
    const auto lies_in_file = [&](const void* p) {
        const auto* const at = static_cast<const std::byte*>(p);
        return at >= first - bytes && at < first + bytes;
    };
    EXPECT_EQ(arrays.nodes.capacity_bytes() + arrays.blocks.capacity_bytes(), 0u);
    EXPECT_TRUE(lies_in_file(arrays.blocks.data()));
    EXPECT_TRUE(lies_in_file(inner.mesh_names.front().mesh.vertices.data()));
    EXPECT_TRUE(lies_in_file(inner.mesh_names.front().mesh.triangles.data()));
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(first) % 64, 0u);
}

TEST_F(RdxSceneTest, LoadedScenesGoOnAsScenes) {
    for (std::uint64_t seed = 0; seed < 4; ++seed) {
        Dice dice(seed);
        const SceneOptions options{.usage = seed % 2 == 0 ? Usage::moving : Usage::fixed};
        Scene scene = random_scene(dice, 1 + static_cast<std::uint32_t>(seed % 2), options);
        scene.add(random_mesh(dice), {.mask = ~0u, .id = 1000});
        scene.remove(1000);
        scene.commit(options);
        static_cast<void>(saved(scene));
        Scene loaded = load_rdx_scene(file()).scene;
        EXPECT_EQ(loaded.commit(options).trees_built, 0u) << "a commit keeps the trees of the file";
        EXPECT_THROW(loaded.add(Mesh{}, {.mask = 1, .id = 1000}), InputError) << "given before";
        const Mesh other = random_mesh(dice);
        const Transform transform = dice.transform(2);
        for (Scene* const each : {&scene, &loaded}) {
            const std::uint32_t id = each->add(other);
            each->set_mask(id, 6);
            for (std::uint32_t k = 0; k < 40; ++k) {
                if (!each->contains(k)) continue;
                try {
                    each->set_transform(k, transform);
                } catch (const InputError&) {
                    k % 2 == 0 ? each->update(k, other) : each->remove(k);
                }
            }
            each->commit(options);
        }
        expect_same(loaded, scene, dice);
    }
}

TEST_F(RdxSceneTest, AMovedMeshOfALoadedSceneIsRefitted) {
    Mesh mesh = random_soup(300, 8);
    Scene scene;
    const SceneOptions moving{.usage = Usage::moving};
    scene.add(mesh);
    scene.commit(moving);
    static_cast<void>(saved(scene));
    Scene loaded = load_rdx_scene(file()).scene;
    for (Vec3& v : mesh.vertices) v.x += 0.01f * v.y;
    loaded.update(0, mesh);
    scene.update(0, mesh);
    EXPECT_EQ(scene.commit(moving).trees_refitted, 1u);
    EXPECT_EQ(loaded.commit(moving).trees_refitted, 1u);
    Dice dice(2);
    expect_same(loaded, scene, dice);
    static_cast<void>(saved(loaded));
    expect_same(load_rdx_scene(file()).scene, scene, dice);
}

TEST_F(RdxSceneTest, OutlivesTheFileAndTheLoadedScene) {
    Dice dice(5);
    const Scene scene = random_scene(dice, 1, {});
    static_cast<void>(saved(scene));
    Scene outer;
    {
        const RdxScene loaded = load_rdx_scene(file());
        std::filesystem::remove(file());
        outer.add(loaded.scene, Transform{});
    }
    outer.commit();
    Scene expected;
    expected.add(scene, Transform{});
    expected.commit();
    expect_same(outer, expected, dice);
}

TEST_F(RdxSceneTest, InstancesThatWouldComeToTooManyParts) {
    // 13 scenes of two instances of the one before: 8,192 parts of 832 bytes.
    std::vector<Scene> scenes;
    scenes.emplace_back(random_soup(3, 1));
    for (int level = 0; level < 13; ++level) {
        Scene next;
        for (int k = 0; k < 2; ++k) {
            Transform at;
            at.m[level % 3][3] = static_cast<float>(k << (level / 3));
            next.add(scenes.back(), at);
        }
        next.commit();
        scenes.push_back(std::move(next));
    }
    // Many such, each of its own.
    Scene whole;
    for (int k = 0; k < 16; ++k) {
        Scene twice;
        twice.add(scenes.back(), Transform{});
        twice.add(scenes.back(), Transform{});
        twice.commit();
        whole.add(twice, Transform{});
    }
    whole.commit();
    EXPECT_LT(saved(whole).size(), 20000u);
    const RdxScene loaded = load_rdx_scene(file());
    std::size_t placed = 0;
    const SceneTree& tree = *SceneInternals::tree(loaded.scene);
    for (const InstanceName& instance : tree.instances) placed += instance.scene->placed.size();
    EXPECT_LT(placed, 200000u);
    const std::vector<Ray> rays(8, Ray{{0.5f, 0.5f, -4}, 0, {0.01f, 0, 1}});
    EXPECT_TRUE(same_hits(trace(loaded.scene, rays), trace(whole, rays)));
}

TEST_F(RdxSceneTest, WhatCannotBeSaved) {
    Scene scene;
    const auto message = [&](const Scene& of, const CameraSet& cameras = {}) {
        return message_of([&] { save_rdx(file(), of, "", cameras); });
    };
    const std::string start = file().string() + ": not written: ";
    EXPECT_EQ(message(scene), start + "scene: it was never committed");
    Mesh mesh = random_soup(5, 2);
    scene.share(mesh);
    scene.commit();
    EXPECT_EQ(message(scene), "no error");
    mesh.vertices[0].x += 1;
    EXPECT_EQ(message(scene), start +
                                  "scenes: geometry 0: its shared arrays changed since the commit, "
                                  "at triangle 0");
    mesh.vertices[0].x -= 1;
    CameraSet bad = cameras_;
    bad.width = 0;
    EXPECT_EQ(message(scene, bad), start + "info: a picture of 0 x 480; sides are 1 to 65536");
    scene.set_mask(0, 1);
    EXPECT_EQ(message(scene), start + "scenes: it has changes that no commit has taken in");
    Scene own;
    const std::vector<Aabb> boxes{{{0, 0, 0}, {1, 1, 1}}};
    own.add(UserGeometry(boxes, [](std::uint32_t, const Ray&, Hit&) { return false; }));
    own.commit();
    EXPECT_EQ(message(own),
              start + "scenes: geometry 0 holds user geometry, which files have no place for");
}

TEST_F(RdxSceneTest, TheOtherKindIsNamed) {
    const Model model{.name = "", .meshes = {random_soup(5, 1)}, .nodes = {}, .cameras = {}};
    save_rdx(file(), build_bvh(model.mesh()), model);
    EXPECT_FALSE(holds_scene(file()));
    EXPECT_EQ(message_of([&] { static_cast<void>(load_rdx_scene(file())); }),
              file().string() +
                  ": header: this file holds a tree, not a scene (load_rdx "
                  "reads it; raydix build --layout wide8 -o saves scenes)");
    static_cast<void>(saved(Scene(model.mesh())));
    EXPECT_EQ(message_of([&] { static_cast<void>(load_rdx(file())); }),
              file().string() + ": header: this file holds a scene, not a tree (load_rdx_scene)");
}

}  // namespace
}  // namespace raydix::test
