// .rdx files of scenes in double: every number comes back as it was, and so does every hit; what is
// wrong with a file is said.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/rdx_scene.h>
#include <raydix/shapes.h>
#include <raydix/surface.h>
#include <raydix/user_geometry.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "io/rdx_faults.h"
#include "io/rdx_parse.h"
#include "io/rdx_scene_format.h"
#include "support/double_scenes.h"
#include "support/message.h"
#include "support/support.h"

namespace raydix::test {
namespace {

Vec3d place(RandomD& dice, double reach) {
    return dice.in({{-reach, -reach, -reach}, {reach, reach, reach}});
}

MeshD soup(RandomD& dice, std::uint32_t count) {
    MeshD mesh;
    for (std::uint32_t i = 0; i < count; ++i) {
        const Vec3d at = place(dice, 1);
        for (int k = 0; k < 3; ++k) {
            const Vec3d by = place(dice, 0.4);
            mesh.vertices.push_back({at.x + by.x, at.y + by.y, at.z + by.z});
        }
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    mesh.vertices.front() = {-0.0, 5e-324, 1.0 / 3};
    if (dice.below(2) == 0) mesh.vertices.back().y = std::numeric_limits<double>::quiet_NaN();
    return mesh;
}

TransformD turned(RandomD& dice) {
    TransformD t;
    for (auto& row : t.m)
        for (double& x : row) x += dice.between(-0.3, 0.3);
    return t;
}

std::vector<RayD> rays_into(RandomD& dice, std::size_t count) {
    std::vector<RayD> rays(count);
    for (RayD& ray : rays) {
        ray.origin = place(dice, 4);
        const Vec3d to = place(dice, 1);
        ray.direction = {to.x - ray.origin.x, to.y - ray.origin.y, to.z - ray.origin.z};
    }
    return rays;
}

/// Meshes, shapes, an empty mesh, holes in the ids; scenes in scenes.
SceneD world(RandomD& dice, int levels, const SceneOptions& options) {
    SceneD scene;
    scene.add(soup(dice, 40), {1u + static_cast<std::uint32_t>(dice.below(7)), 3});
    scene.add(MeshD{}, {});
    const std::vector<SphereD> balls{{place(dice, 1), 1.0 / 7}, {place(dice, 1), 0.2}};
    scene.add(std::span<const SphereD>(balls), {.id = 8});
    const std::vector<CapsuleD> rods{{place(dice, 1), place(dice, 1), 1.0 / 9}};
    scene.add(std::span<const CapsuleD>(rods));
    const std::vector<Vec3d> dots{place(dice, 1), place(dice, 1)};
    scene.add(dots, 1.0 / 11, {.mask = 5});
    if (levels > 0) {
        const SceneD inner = world(dice, levels - 1, options);
        scene.add(inner, turned(dice), {.mask = 6});
        scene.add(inner, turned(dice), {.id = 70});
    }
    scene.remove(scene.add(soup(dice, 2), {.id = 90}));
    scene.commit(options);
    return scene;
}

class RdxDouble : public ::testing::Test {
protected:
    [[nodiscard]] std::filesystem::path file() const { return folder_.path() / "scene.rdx"; }
    Bytes saved(const SceneD& scene) {
        save_rdx(file(), scene, "far", cameras_);
        return read_bytes(file());
    }

    TempFolder folder_;
    const CameraSetD cameras_{
        640, 480, 0.5f, {{"south", {1.0 / 3, 4.5e6, 0}, {}, {0, 1, 0}, 33.3}}};
};

TEST_F(RdxDouble, LoadedScenesHaveTheSameHits) {
    RandomD dice(11);
    std::size_t found = 0;
    for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high})
        for (int levels = 0; levels < 3; ++levels) {
            const SceneOptions options{.quality = quality, .usage = Usage::moving};
            const SceneD scene = world(dice, levels, options);
            const Bytes bytes = saved(scene);
            EXPECT_TRUE(holds_scene(file()) && holds_scene_double(file()));
            RdxSceneD loaded = load_rdx_scene_double(file());
            EXPECT_TRUE(loaded.scene.committed());
            EXPECT_EQ(loaded.options.quality, quality);
            EXPECT_EQ(loaded.options.usage, Usage::moving);
            EXPECT_EQ(loaded.name, "far");
            ASSERT_EQ(loaded.cameras.cameras.size(), 1u);
            EXPECT_EQ(loaded.cameras.cameras[0].position.x, 1.0 / 3);
            EXPECT_EQ(loaded.cameras.cameras[0].vfov, 33.3);
            EXPECT_EQ(loaded.cameras.height, 480u);
            EXPECT_EQ(loaded.shape_ids, (std::vector<std::uint32_t>{1, 2, 8}));
            EXPECT_EQ(loaded.counts.scenes, static_cast<std::uint64_t>(levels + 1));
            EXPECT_EQ(loaded.scene.ids(), scene.ids());
            const auto mesh = *scene.mesh(3), again = *loaded.scene.mesh(3);
            ASSERT_EQ(mesh.vertices.size(), again.vertices.size());
            EXPECT_EQ(std::memcmp(mesh.vertices.data(), again.vertices.data(),
                                  mesh.vertices.size_bytes()),
                      0);
            const std::vector<RayD> rays = rays_into(dice, 500);
            for (const std::uint32_t mask : {0xFFFFFFFFu, 4u}) {
                const auto wanted = trace(scene, rays, {.mask = mask});
                EXPECT_EQ(trace(loaded.scene, rays, {.mask = mask}), wanted);
                found += static_cast<std::size_t>(std::ranges::count_if(wanted, &HitD::hit));
            }
            EXPECT_TRUE(std::ranges::equal(trace_all(loaded.scene, rays).hits,
                                           trace_all(scene, rays).hits));
            save_rdx(file(), loaded.scene, "far", cameras_);
            EXPECT_EQ(read_bytes(file()), bytes);
            EXPECT_EQ(loaded.scene.commit(loaded.options).trees_built, 0u);
            EXPECT_NE(message_of([&] { loaded.scene.add(MeshD{}, {.id = 90}); }), "no error");
        }
    EXPECT_GT(found, 1000u);
}

/// What the reader says to these bytes; "" if it takes them. Rays go through what it took.
std::string said_of(std::span<const std::byte> bytes) {
    return verdict_of(bytes, [](std::span<std::byte> copy, const std::shared_ptr<void>& owner) {
        const RdxSceneD file = rdx::parse_scene_double("x.rdx", copy, owner);
        RandomD dice(1);
        const std::vector<RayD> rays = rays_into(dice, 20);
        std::vector<Vec3d> points(rays.size());
        positions(file.scene, rays, trace(file.scene, rays, {.threads = 1}), points, 1);
    });
}

TEST_F(RdxDouble, EveryBitCountsAndNoneBreaksTheReader) {
    RandomD dice(12);
    const Bytes good = saved(world(dice, 1, {}));
    ASSERT_EQ(said_of(good), "");
    for (std::size_t at = 0; at < good.size(); at += 1 + dice.below(40)) {
        Bytes bad = good;
        bad[at] ^= std::byte{1} << dice.below(8);
        EXPECT_NE(said_of(bad), "") << "byte " << at;
        seal_rdx(bad);  // a writer that lies: refused, or a scene that bears being traced
        static_cast<void>(said_of(bad));
    }
    for (std::size_t length = 0; length < good.size(); length += 1 + dice.below(300)) {
        Bytes bad(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(length));
        EXPECT_NE(said_of(bad), "") << length << " bytes";
    }
}

TEST_F(RdxDouble, MeshesStandInOnePlaceAlone) {
    RandomD dice(13);
    SceneD scene;
    scene.add(soup(dice, 5));
    scene.add(soup(dice, 5));
    scene.commit();
    Bytes bytes = saved(scene);
    rdx::Section section;
    std::memcpy(
        &section,
        bytes.data() + sizeof(rdx::HeaderStart) + rdx::double_geometries * sizeof(rdx::Section),
        sizeof(section));
    auto* const geometries = reinterpret_cast<StoredGeometryD*>(bytes.data() + section.offset);
    geometries[1].number = 0;
    seal_rdx(bytes);
    EXPECT_EQ(said_of(bytes), "x.rdx: geometries: scene 0: geometry 1 is mesh 0 once more");
}

TEST_F(RdxDouble, WhatCannotBeSavedOrLoadedIsNamed) {
    RandomD dice(14);
    SceneD scene = world(dice, 0, {});
    saved(scene);
    EXPECT_NE(message_of([&] {
                  static_cast<void>(load_rdx_scene(file()));
              }).find("this file holds a scene in double (load_rdx_scene_double)"),
              std::string::npos);
    scene.add(soup(dice, 1));
    EXPECT_NE(message_of([&] { saved(scene); }).find("changes that no commit"), std::string::npos);
    const std::vector<AabbD> boxes{{{0, 0, 0}, {1, 1, 1}}};
    scene.add(UserGeometryD(boxes, [](std::uint32_t, const RayD&, HitD&) { return false; }));
    scene.commit();
    EXPECT_NE(message_of([&] { saved(scene); }).find("user geometry"), std::string::npos);
    Scene single;
    single.commit();
    save_rdx(file(), single);
    EXPECT_FALSE(holds_scene_double(file()));
    EXPECT_NE(message_of([&] {
                  static_cast<void>(load_rdx_scene_double(file()));
              }).find("this file holds a scene in float (load_rdx_scene)"),
              std::string::npos);
}

}  // namespace
}  // namespace raydix::test
