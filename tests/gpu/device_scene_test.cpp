// Scenes of meshes as devices trace them (raydix/device_scene.h): one tree over all meshes, whose
// hits are named by the host's call, and by the functor of a GPU in order and shuffled. They are
// those of the scene, bit for bit, for every mask.
#include <gtest/gtest.h>
#include <raydix/cwbvh.h>
#include <raydix/device_scene.h>
#include <raydix/error.h>
#include <raydix/simulate.h>

#include <cmath>
#include <iostream>

#include "engine/name_hit.h"
#include "exec/host_launcher.h"
#include "support/cwbvh_trace.h"
#include "support/launched_queries.h"
#include "support/ray_sets.h"
#include "support/scenes.h"
#include "support/shuffled_launcher.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t device_scene_seed = 1609;
constexpr std::uint32_t all = 0xFFFFFFFFu;

struct Item {
    Mesh mesh;
    GeometryOptions options = {};
};

Scene committed(const std::vector<Item>& items, const SceneOptions& options = {}) {
    Scene scene;
    for (const Item& item : items) scene.add(item.mesh, item.options);
    scene.commit(options);
    return scene;
}

/// Hits by a tree over the merged meshes, before they are named.
std::vector<TreeHit> tree_hits(const MergedMeshes& merged, std::span<const Ray> rays) {
    const std::vector<Hit> hits = trace(Cwbvh(build_bvh(merged.mesh)), rays);
    return {hits.begin(), hits.end()};
}

/// Every way to name them.
void expect_named(const MeshNames& names, const std::vector<TreeHit>& found,
                  const std::vector<Hit>& wanted) {
    GuardedArray<Hit> hits(found.size());
    name_hits(names, found, hits.span());
    EXPECT_EQ(hits.differences(wanted), 0u);
    const NamesView view{names.first.data(), names.ids.data(),
                         static_cast<std::uint32_t>(names.ids.size())};
    const auto launched = [&](auto& launcher) {
        GuardedArray<Hit> out(found.size());
        launcher.launch("scene.name", static_cast<std::uint32_t>(found.size()),
                        NameHit{view, found.data(), out.span().data()});
        EXPECT_EQ(out.differences(wanted), 0u);
    };
    HostLauncher<> host;
    launched(host);
    ShuffledLauncher shuffled(device_scene_seed);
    launched(shuffled);
}

std::size_t compare(const std::string& what, const Scene& scene, std::size_t ray_count) {
    const MergedMeshes whole = merge_meshes(scene, all);
    std::vector<Ray> rays = make_mixed_rays(
        scene_of(whole.mesh.triangles.empty() ? random_soup(3, 1) : whole.mesh, what), ray_count,
        device_scene_seed);
    if (rays.size() > 2) rays[1].direction = {0, 0, 0};
    std::size_t hits = 0;
    for (const std::uint32_t mask : {all, 1u, 6u, 0u}) {
        SCOPED_TRACE(what + ", mask " + std::to_string(mask) + ", seed " +
                     std::to_string(device_scene_seed));
        const MergedMeshes merged = merge_meshes(scene, mask);
        const std::vector<Hit> wanted = trace(scene, rays, {.mask = mask});
        expect_named(merged.names, tree_hits(merged, rays), wanted);
        for (const Hit& hit : wanted) hits += hit.hit();
    }
    return hits;
}

TEST(DeviceScene, HitsAreThoseOfTheScene) {
    Mesh laced = random_soup(120, 4, 0.4f);
    for (std::size_t i = 0; i < laced.vertices.size(); i += 7) laced.vertices[i].x = std::nanf("");
    const Mesh lattice = lattice_mesh(60, 3, device_scene_seed);
    const std::vector<std::pair<std::string, std::vector<Item>>> cases = {
        {"nothing", {}},
        {"no triangles", {{Mesh()}, {Mesh()}}},
        {"one, chosen id", {{random_soup(50, 1, 0.5f), {.id = 7}}}},
        {"one triangle each", {{random_soup(1, 1, 2.0f)}, {random_soup(1, 2, 2.0f)}}},
        {"ties between meshes", {{lattice}, {lattice}, {lattice_mesh(200, 4, 5)}, {lattice}}},
        {"masks",
         {{random_soup(80, 2, 0.4f), {.mask = 1}},
          {random_soup(80, 3, 0.4f), {.mask = 2}},
          {lattice, {.mask = 0}},
          {random_soup(80, 5, 0.4f), {.mask = 5}},
          {lattice}}},
        {"empty ones between, ids with holes",
         {{Mesh()},
          {laced, {.id = 3}},
          {Mesh(), {.id = 4}},
          {lattice, {.id = 0xFFFFFFFEu}},
          {random_soup(9, 7, 1.0f), {.id = 2}}}}};
    std::size_t hits = 0;
    for (const auto& [name, items] : cases)
        for (const Usage usage : {Usage::fixed, Usage::moving})
            hits += compare(name, committed(items, {.usage = usage}), 400);
    std::vector<Item> many;
    for (std::uint32_t i = 0; i < 300; ++i)
        many.push_back({random_soup(i % 5, i + 1, 0.3f), {.mask = i % 3 == 0 ? 1 : all}});
    hits += compare("many", committed(many), 4000);
    hits +=
        compare("far out", committed({{scaled(lattice, 1e11f)}, {scaled(lattice, -1e11f)}}), 400);
    std::cout << hits << " hits compared\n";
    EXPECT_GT(hits, 5000u);
}

TEST(DeviceScene, TakesTheLastCommit) {
    Scene scene = committed({{random_soup(40, 1, 0.5f)}, {random_soup(30, 2, 0.5f)}});
    const MergedMeshes before = merge_meshes(scene);
    scene.add(random_soup(20, 3));
    scene.update(0, random_soup(10, 4));
    scene.set_mask(1, 0);
    const MergedMeshes still = merge_meshes(scene);
    EXPECT_EQ(still.names.ids, before.names.ids);
    EXPECT_EQ(still.names.first, (std::vector<std::uint32_t>{0, 40}));
    ASSERT_EQ(still.mesh.triangles, before.mesh.triangles);
    scene.commit();
    EXPECT_EQ(merge_meshes(scene).names.ids, (std::vector<std::uint32_t>{0, 2}));
    EXPECT_EQ(merge_meshes(scene).names.first, (std::vector<std::uint32_t>{0, 10}));
    compare("committed", scene, 300);
}

/// The simulator's kernels test triangles in another way, so that hits are judged by what they
/// name: the corners of the triangle, and where it lies.
TEST(DeviceScene, SimulatedHitsNameTheirTriangles) {
    std::vector<Item> items;
    for (std::uint32_t i = 0; i < 12; ++i) items.push_back({random_soup(50, i + 1, 0.3f)});
    const Scene scene = committed(items);
    const MergedMeshes merged = merge_meshes(scene);
    const std::vector<Ray> rays =
        make_rays(scene_of(merged.mesh, "soups"), RaySet::through_box, 2000, device_scene_seed);
    const WarpTree tree(build_bvh(merged.mesh));
    const SimulateOptions run{.kernel = WarpKernel::speculative_while_while,
                              .machine = machine_model("h200")};
    std::vector<std::vector<TreeHit>> found;
    static_cast<void>(simulate(tree, rays, {&run, 1}, &found));
    std::vector<Hit> hits(rays.size());
    name_hits(merged.names, found.front(), hits);
    const std::vector<Hit> wanted = trace(scene, rays);
    std::size_t named = 0, other = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        other += hits[i].geometry != wanted[i].geometry || hits[i].prim != wanted[i].prim;
        if (!hits[i].hit()) {
            EXPECT_EQ(hits[i].geometry, no_primitive);
            continue;
        }
        ++named;
        ASSERT_LT(hits[i].geometry, items.size());
        const Mesh& mesh = items[hits[i].geometry].mesh;
        ASSERT_LT(hits[i].prim, mesh.triangles.size());
        for (std::size_t k = 0; k < 3; ++k) {
            const Vec3 a = mesh.vertices[mesh.triangles[hits[i].prim][k]];
            const Triangle& whole = merged.mesh.triangles[found.front()[i].prim];
            const Vec3 b = merged.mesh.vertices[whole[k]];
            EXPECT_TRUE(a.x == b.x && a.y == b.y && a.z == b.z);
        }
    }
    EXPECT_GT(named, 500u);
    EXPECT_LE(other, 5u);  // in the last bits
}

TEST(DeviceScene, SaysWhatItCannotDo) {
    Scene scene;
    EXPECT_THROW(static_cast<void>(merge_meshes(scene)), InputError);
    const Scene inner(random_soup(4, 1));
    scene.add(random_soup(4, 2));
    scene.add(inner, {});
    scene.commit();
    try {
        static_cast<void>(merge_meshes(scene));
        FAIL() << "an instance was taken";
    } catch (const BackendUnavailable& error) {
        EXPECT_NE(std::string(error.what()).find("geometry 1 is an instance"), std::string::npos)
            << error.what();
    }
    std::vector<TreeHit> found(3);
    std::vector<Hit> hits(2);
    EXPECT_THROW(name_hits({}, found, hits), InputError);
    if (!device_available()) {
        EXPECT_THROW(DeviceMeshNames(merge_meshes(inner).names), BackendUnavailable);
        EXPECT_THROW(name_hits_on_device({}, {}, {}, nullptr), BackendUnavailable);
    }
}

/// Not by names of its own meshes: nothing is read that is not there.
TEST(DeviceScene, HitsOfAnotherTree) {
    const std::vector<TreeHit> found{{1, 5, 0, 0}, {}};
    std::vector<Hit> hits(2);
    name_hits({}, found, hits);
    EXPECT_EQ(hits[0].prim, 5u);
    EXPECT_EQ(hits[0].geometry, no_primitive);
    name_hits({{0, 3}, {4, 9}}, found, hits);
    EXPECT_EQ(hits[0].prim, 2u);
    EXPECT_EQ(hits[0].geometry, 9u);
    EXPECT_FALSE(hits[1].hit());
}

}  // namespace
}  // namespace raydix::test
