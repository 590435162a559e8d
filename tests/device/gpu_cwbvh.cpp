// Rays through compressed wide trees on a device against `scalar`, bit for bit: closest and any
// hit, both kernels, any number of rays; results beyond the last ray stay untouched. Skipped where
// there is no device.
#include <gtest/gtest.h>
#include <raydix/cwbvh.h>
#include <raydix/device.h>
#include <raydix/device_cwbvh.h>
#include <raydix/device_scene.h>
#include <raydix/raydix.h>
#include <raydix/trace.h>

#include <cmath>
#include <cstring>

#include "device/device_test.h"
#include "support/ray_sets.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t seed = 2017;
constexpr CwbvhKernel kernels[] = {CwbvhKernel::cwbvh, CwbvhKernel::persistent_cwbvh};

class GpuCwbvh : public DeviceTest {};

struct Results {
    std::vector<TreeHit> hits;
    std::vector<std::uint8_t> occluded;
};

/// Both calls; one place behind the last ray keeps its pattern.
Results results_of(const DeviceCwbvhTree& tree, std::span<const Ray> rays, CwbvhKernel kernel) {
    const auto n = static_cast<std::uint32_t>(rays.size());
    const DeviceBuffer<Ray> input(rays);
    Results results{std::vector<TreeHit>(n + 1, TreeHit{7, 7, 7, 7}),
                    std::vector<std::uint8_t>(n + 1, 77)};
    DeviceBuffer<TreeHit> hits{std::span<const TreeHit>(results.hits)};
    DeviceBuffer<std::uint8_t> occluded{std::span<const std::uint8_t>(results.occluded)};
    DeviceBuffer<std::byte> scratch(256);
    const std::span<std::byte> lent(scratch.data(), device_cwbvh_scratch_bytes(kernel));
    trace_on_device(tree, input.data(), n, hits.data(), kernel, lent, nullptr);
    trace_any_on_device(tree, input.data(), n, occluded.data(), kernel, lent, nullptr);
    hits.download(results.hits);
    occluded.download(results.occluded);
    EXPECT_EQ(results.hits.back().prim, 7u);
    EXPECT_EQ(results.occluded.back(), 77);
    results.hits.pop_back();
    results.occluded.pop_back();
    return results;
}

void compare(const std::string& what, const Bvh& bvh, std::span<const Ray> rays) {
    const DeviceCwbvh device{Cwbvh(bvh)};
    const std::vector<Hit> wanted = trace(bvh, rays);
    for (const CwbvhKernel kernel : kernels) {
        SCOPED_TRACE(what + ", kernel " + std::to_string(static_cast<int>(kernel)) + ", seed " +
                     std::to_string(seed));
        const Results results = results_of(device.tree(), rays, kernel);
        std::uint64_t different = 0, wrong = 0;
        for (std::size_t i = 0; i < rays.size(); ++i) {
            different += std::memcmp(&results.hits[i], &wanted[i], sizeof(TreeHit)) != 0;
            wrong += (results.occluded[i] != 0) != wanted[i].hit();
        }
        EXPECT_EQ(different, 0u);
        EXPECT_EQ(wrong, 0u);
    }
}

TEST_F(GpuCwbvh, LikeScalar) {
    for (const Model& scene : fitting(builtin_triangle_scenes(fitting(200'000))))
        compare(scene.name, build_bvh(scene.mesh()),
                make_mixed_rays(scene, fitting(1'000'000), seed));
    for (const float scale : {1e-9f, 1.0f, 1e12f}) {
        const Model scene = scene_of(scaled(random_soup(2000, 4), scale), "soup");
        compare("soup times " + std::to_string(scale), build_bvh(scene.mesh()),
                make_mixed_rays(scene, fitting(200'000), seed));
    }
    const Model lattice = scene_of(lattice_mesh(2000, 20, 5), "lattice");
    compare("lattice", build_bvh(lattice.mesh()), make_mixed_rays(lattice, fitting(200'000), seed));
}

TEST_F(GpuCwbvh, FewTrianglesAndFewRays) {
    const Mesh all = random_soup(12, seed, 1.0f);
    const auto rays = make_mixed_rays(scene_of(all, "few"), 700, seed);
    for (std::size_t n = 0; n <= 12; ++n) {
        Mesh mesh = all;
        mesh.triangles.resize(n);
        if (n == 0) mesh.vertices.clear();
        const Bvh bvh = build_bvh(mesh);
        for (const std::size_t count : {0u, 1u, 31u, 33u, 129u, 700u})
            compare(std::to_string(n) + " triangles, " + std::to_string(count) + " rays", bvh,
                    std::span(rays).first(count));
    }
}

TEST_F(GpuCwbvh, InvalidRaysMiss) {
    const Model scene = scene_of(random_soup(500, 3, 0.5f), "soup");
    auto rays = make_mixed_rays(scene, fitting(50'000), seed);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (i % 3 == 0) rays[i].direction = {0, 0, 0};
        if (i % 7 == 0) rays[i].origin.y = std::nanf("");
        if (i / 1000 % 2 == 0) rays[i].tmin = infinity;
    }
    compare("invalid rays", build_bvh(scene.mesh()), rays);
}

/// Meshes of a scene as one, hits named where they lie.
TEST_F(GpuCwbvh, ScenesOfMeshes) {
    Scene scene;
    for (std::uint32_t i = 0; i < 500; ++i)
        scene.add(random_soup(i % 7 * 20, i + 1, 0.1f), {.mask = i % 5 == 0 ? 2u : 0xFFFFFFFFu});
    scene.add(lattice_mesh(2000, 20, 5));
    scene.add(lattice_mesh(2000, 20, 5));
    scene.commit();
    const auto rays =
        make_mixed_rays(scene_of(merge_meshes(scene).mesh, "meshes"), fitting(500'000), seed);
    const DeviceBuffer<Ray> there{std::span<const Ray>(rays)};
    const auto n = static_cast<std::uint32_t>(rays.size());
    for (const std::uint32_t mask : {0xFFFFFFFFu, 1u, 0u}) {
        SCOPED_TRACE("mask " + std::to_string(mask));
        const MergedMeshes merged = merge_meshes(scene, mask);
        const DeviceCwbvh tree{Cwbvh(build_bvh(merged.mesh))};
        const DeviceMeshNames names(merged.names);
        const DeviceBuffer<TreeHit> found(n);
        std::vector<Hit> hits(n + 1);
        hits.back().prim = 7;
        const DeviceBuffer<Hit> named{std::span<const Hit>(hits)};
        trace_on_device(tree.tree(), there.data(), n, found.data(), CwbvhKernel::cwbvh, {},
                        nullptr);
        name_hits_on_device(names, {found.data(), n}, {named.data(), n}, nullptr);
        named.download(hits);
        const std::vector<Hit> wanted = trace(scene, rays, {.mask = mask});
        std::uint64_t different = 0;
        for (std::size_t i = 0; i < n; ++i)
            different += std::memcmp(&hits[i], &wanted[i], sizeof(Hit)) != 0;
        EXPECT_EQ(different, 0u);
        EXPECT_EQ(hits.back().prim, 7u);
    }
    const DeviceBuffer<TreeHit> two(2);
    EXPECT_THROW(name_hits_on_device({}, {two.data(), 2}, {}, nullptr), InputError);
}

TEST_F(GpuCwbvh, RefusesWhatItCannotDo) {
    const DeviceCwbvh device{Cwbvh(build_bvh(random_soup(100, 1)))};
    DeviceCwbvhTree tree = device.tree();
    EXPECT_THROW(
        trace_on_device(tree, nullptr, 1, nullptr, CwbvhKernel::persistent_cwbvh, {}, nullptr),
        InputError);
    tree.max_depth = device_cwbvh_max_depth + 1;
    EXPECT_THROW(trace_on_device(tree, nullptr, 1, nullptr, CwbvhKernel::cwbvh, {}, nullptr),
                 InputError);
}

}  // namespace
}  // namespace raydix::test
