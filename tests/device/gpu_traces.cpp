// Every warp kernel on a device against the scalar reference: the same hits, bit for bit, from
// trees copied there and trees built there; trees of no and few triangles, invalid and scaled rays,
// on a stream of the caller's, never more memory touched than was lent. Skipped where there is no
// device.
#include <gtest/gtest.h>
#include <raydix/device_trace.h>
#include <raydix/error.h>
#include <raydix/model.h>

#include <cmath>
#include <cstring>
#include <iostream>

#include "device/device_test.h"
#include "measure/stopwatch.h"
#include "support/ray_sets.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

class GpuTrace : public DeviceTest {};

struct Traced {
    std::vector<TreeHit> hits;
    std::uint32_t invalid = 0;
};

Traced trace_there(const DeviceWarpTree& tree, std::span<const Ray> rays, WarpKernel kernel,
                   bool any_hit) {
    constexpr std::size_t guard = 4096;
    const std::uint32_t none = 0;
    const DeviceBuffer<Ray> from(rays);
    const std::vector<TreeHit> garbage(rays.size(), TreeHit{-5.0f, 3, 2.0f, 1.0f});
    const DeviceBuffer<TreeHit> to{std::span<const TreeHit>(garbage)};
    const DeviceBuffer<std::uint32_t> invalid{std::span(&none, 1)};
    const DeviceTraceOptions options{
        .kernel = kernel, .any_hit = any_hit, .invalid_rays = invalid.data()};
    const std::size_t bytes =
        device_trace_scratch_bytes(tree, static_cast<std::uint32_t>(rays.size()), options);
    const std::vector<std::byte> pattern(bytes + guard, std::byte{0x5A});
    const DeviceBuffer<std::byte> scratch{std::span<const std::byte>(pattern)};
    trace_warps_on_device(tree, {from.data(), rays.size()}, {to.data(), rays.size()}, options,
                          {scratch.data(), bytes}, nullptr);
    Traced result;
    result.hits.resize(rays.size());
    to.download(result.hits);
    invalid.download({&result.invalid, 1});
    std::vector<std::byte> after(bytes + guard);
    scratch.download(after);
    EXPECT_TRUE(std::equal(after.end() - guard, after.end(), pattern.end() - guard));
    return result;
}

void compare(const std::string& what, const WarpTree& host, const DeviceWarpTree& tree,
             std::span<const Ray> rays, bool has_wide = true) {
    for (const bool any_hit : {false, true}) {
        std::vector<TreeHit> expected(rays.size());
        trace_reference(host, rays, expected, any_hit);
        for (const WarpKernel kernel : warp_kernels()) {
            SCOPED_TRACE(what + ", " + std::string(warp_kernel_name(kernel)) +
                         (any_hit ? ", any" : ", closest"));
            if (reads_wide_nodes(kernel) && !has_wide) {
                EXPECT_THROW(trace_there(tree, rays, kernel, any_hit), InputError);
                continue;
            }
            const Traced traced = trace_there(tree, rays, kernel, any_hit);
            std::size_t different = 0;
            for (std::size_t i = 0; i < rays.size(); ++i)
                different += any_hit
                                 ? traced.hits[i].hit() != expected[i].hit()
                                 : std::memcmp(&traced.hits[i], &expected[i], sizeof(TreeHit)) != 0;
            EXPECT_EQ(different, 0u) << "of " << rays.size();
        }
    }
}

TEST_F(GpuTrace, FewTrianglesAndFewRays) {
    for (const std::size_t n : {0u, 1u, 2u, 3u, 40u}) {
        const Model scene = scene_of(random_soup(n, n + 1, 0.5f), "soup");
        const WarpTree host(build_bvh(scene.mesh(), {.max_leaf = 2}), true);
        const DeviceWarpTree tree(host);
        EXPECT_EQ(tree.empty(), n == 0);
        for (const std::size_t count : {0u, 1u, 31u, 33u, 500u}) {
            const Model aimed = scene_of(random_soup(40, 2, 0.5f), "soup");
            compare(std::to_string(n) + " triangles", host, tree, make_mixed_rays(aimed, count, 5));
        }
    }
}

TEST_F(GpuTrace, EachBuiltinScene) {
    for (const Model& scene : fitting(builtin_triangle_scenes(fitting(200'000)))) {
        const WarpTree host(build_bvh(scene.mesh(), {.builder = Builder::ploc}), true);
        compare(scene.name, host, DeviceWarpTree(host),
                make_mixed_rays(scene, fitting(200'000), 9));
    }
}

TEST_F(GpuTrace, AMillionRaysThroughEachKernel) {
    const Model scene = scene_of(random_soup(2000, 11, 0.02f), "soup");
    const WarpTree host(build_bvh(scene.mesh(), {.builder = Builder::ploc}), true);
    const DeviceWarpTree tree(host);
    const std::vector<Ray> rays = make_mixed_rays(scene, 1'000'000, 12);
    std::vector<TreeHit> expected(rays.size());
    trace_reference(host, rays, expected, false);
    for (const WarpKernel kernel : warp_kernels()) {
        Stopwatch watch;
        const Traced traced = trace_there(tree, rays, kernel, false);
        std::cout << warp_kernel_name(kernel) << ": " << watch.lap() << " ms with copies, "
                  << (on_opencl() ? "OpenCL on a CPU" : "CUDA") << "\n";
        EXPECT_EQ(std::memcmp(traced.hits.data(), expected.data(), rays.size() * sizeof(TreeHit)),
                  0)
            << warp_kernel_name(kernel);
    }
}

TEST_F(GpuTrace, ATreeThatWasBuiltThere) {
    const Mesh mesh = random_soup(60'000, 8);
    const DeviceBuffer<Vec3> vertices{std::span<const Vec3>(mesh.vertices)};
    const DeviceBuffer<Triangle> triangles{std::span<const Triangle>(mesh.triangles)};
    DeviceBvh built(PrimitiveKind::triangles, 60'000, {}, true);
    built.build(DeviceMesh{vertices.data(), static_cast<std::uint32_t>(vertices.size()),
                           triangles.data(), static_cast<std::uint32_t>(triangles.size())});
    const Model scene = scene_of(mesh, "soup");
    compare("built there", WarpTree(build_bvh(mesh, {})), DeviceWarpTree(built.tree()),
            make_mixed_rays(scene, fitting(100'000), 4), false);
    DeviceBvh without(PrimitiveKind::triangles, 60'000, {});
    EXPECT_THROW(DeviceWarpTree(without.tree()), InputError);
}

TEST_F(GpuTrace, InvalidRaysAreCountedAndMiss) {
    const Model scene = scene_of(random_soup(1000, 8), "soup");
    const WarpTree host(build_bvh(scene.mesh(), {}), true);
    const DeviceWarpTree tree(host);
    std::vector<Ray> rays = make_mixed_rays(scene, 1000, 2);
    for (std::size_t i = 0; i < rays.size(); i += 10) rays[i].direction.y = std::nanf("");
    for (const WarpKernel kernel : warp_kernels()) {
        const Traced traced = trace_there(tree, rays, kernel, false);
        EXPECT_GE(traced.invalid, 100u) << warp_kernel_name(kernel);
        for (std::size_t i = 0; i < rays.size(); i += 10) EXPECT_FALSE(traced.hits[i].hit());
    }
}

TEST_F(GpuTrace, WhatDoesNotFitIsRefused) {
    const Model scene = scene_of(random_soup(100, 8), "soup");
    const DeviceWarpTree tree(WarpTree(build_bvh(scene.mesh(), {})));
    const DeviceBuffer<Ray> rays(64);
    const DeviceBuffer<TreeHit> hits(64);
    const DeviceTraceOptions options;
    const std::size_t bytes = device_trace_scratch_bytes(tree, 64, options);
    const DeviceBuffer<std::byte> scratch(bytes);
    const auto launch = [&](std::size_t ray_count, std::size_t hit_count,
                            std::size_t scratch_bytes) {
        trace_warps_on_device(tree, {rays.data(), ray_count}, {hits.data(), hit_count}, options,
                              {scratch.data(), scratch_bytes}, nullptr);
    };
    EXPECT_THROW(launch(64, 63, bytes), InputError);
    EXPECT_THROW(launch(64, 64, bytes - 1), InputError);
}

}  // namespace
}  // namespace raydix::test
