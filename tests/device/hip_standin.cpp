// The HIP backend over a stand-in for AMD's runtime (standin/hip_runtime.cpp says what that
// proves): devices and their errors, builds, rays and queries against the host's, the caller's
// stream, and every call that fails, after which nothing may be left. No GPU of AMD is needed, and
// none is used.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <raydix/cwbvh.h>
#include <raydix/device_cwbvh.h>
#include <raydix/device_queries.h>
#include <raydix/device_trace.h>
#include <raydix/raydix.h>

#include <cstring>
#include <sstream>

#include "device/device_test.h"
#include "device/standin/standin.h"
#include "exec/code_object.h"
#include "exec/hip_device.h"
#include "gpu/device_fetch.h"
#include "support/ray_sets.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

/// Those that the library has kernels for: a device of each.
std::vector<std::string> architectures() {
    std::vector<std::string> names;
    std::istringstream words(code_object_names());
    for (std::string word; words >> word;) names.push_back(word.substr(0, word.find(',')));
    return names;
}

class HipStandIn : public ::testing::Test {
protected:
    void SetUp() override {
        library_ = dlopen("libamdhip64.so", RTLD_NOW | RTLD_LOCAL);
        ASSERT_NE(library_, nullptr) << dlerror();
        ASSERT_NE(dlsym(library_, "standin_heal"), nullptr) << "this is AMD's own runtime";
        all_devices();
        try {
            static_cast<void>(open_hip_device(0));
        } catch (const BackendUnavailable& reason) {  // the stand-in has no OpenCL device
            if (environment("RAYDIX_DEVICE_REQUIRED", "") == "opencl") FAIL() << reason.what();
            GTEST_SKIP() << reason.what();
        }
    }
    void TearDown() override {
        heal();
        all_devices();
    }

    template <class Function>
    Function* call(const char* name) {
        return reinterpret_cast<Function*>(dlsym(library_, name));
    }
    void devices(const char* architectures) {
        call<void(const char*)>("standin_devices")(architectures);
    }
    void all_devices() {
        std::string names;
        for (const std::string& name : architectures()) names += name + ' ';
        devices(names.c_str());
    }
    void fail(const char* what, int status, int after = 0) {
        call<void(const char*, int, int)>("standin_fail")(what, status, after);
    }
    void heal() { call<void()>("standin_heal")(); }
    standin::Figures figures() {
        standin::Figures f{};
        call<void(standin::Figures*)>("standin_figures")(&f);
        return f;
    }
    /// What `run` throws; "" if nothing.
    template <class Error, class Run>
    std::string fault(const Run& run) {
        try {
            run();
        } catch (const Error& error) {
            return error.what();
        }
        return "";
    }

    void* library_ = nullptr;
};

TEST_F(HipStandIn, DevicesAreListed) {
    const auto rows = [] {
        std::vector<DeviceDescription> hip;
        for (const DeviceDescription& row : list_devices())
            if (row.selector.starts_with("hip")) hip.push_back(row);
        return hip;
    };
    const std::vector<std::string> embedded = architectures();
    ASSERT_EQ(rows().size(), embedded.size());
    for (std::size_t k = 0; k < embedded.size(); ++k) {
        EXPECT_EQ(rows()[k].selector, "hip:" + std::to_string(k));
        EXPECT_EQ(rows()[k].driver, embedded[k] + ", HIP 6.4");
        EXPECT_TRUE(rows()[k].name.starts_with("stand-in " + std::to_string(k)));
        EXPECT_EQ(rows()[k].missing, "");
    }
    devices(("gfx803 " + embedded[0]).c_str());
    EXPECT_TRUE(
        rows()[0].missing.ends_with("is gfx803; this build has kernels for " + code_object_names()))
        << rows()[0].missing;
    EXPECT_EQ(rows()[1].missing, "");
    devices("");
    ASSERT_EQ(rows().size(), 1u);
    EXPECT_EQ(rows()[0].missing,
              "device hip: the runtime found no device: no ROCm-capable device "
              "is detected (100)");
}

TEST_F(HipStandIn, WhatKeepsADeviceFromOpeningIsTold) {
    const auto before = figures();
    const auto open = [&](std::uint32_t k) {
        return fault<std::runtime_error>([&] { static_cast<void>(open_hip_device(k)); });
    };
    devices("gfx803");
    EXPECT_NE(open(0).find("gfx803"), std::string::npos);
    EXPECT_EQ(open(7), "device hip:7: there are 1 HIP devices");
    devices("nonsense");
    EXPECT_NE(open(0).find("hipDeviceProp_t"), std::string::npos);
    all_devices();
    for (const char* call :
         {"hipInit", "hipGetDeviceCount", "hipModuleLoadData", "hipStreamCreateWithFlags",
          "hipMalloc", "hipModuleGetFunction", "hipModuleLaunchKernel", "hipMemcpyAsync"}) {
        fail(call, 2);
        const std::string told = open(0);
        EXPECT_NE(told.find("out of memory (2)"), std::string::npos) << call << ": " << told;
        heal();
    }
    const auto after = figures();
    EXPECT_EQ(after.allocations, before.allocations);
    EXPECT_EQ(after.modules, before.modules);
    EXPECT_EQ(after.streams, before.streams);
    EXPECT_EQ(open(0), "");
}

TEST_F(HipStandIn, DevicesReleaseWhatTheyMake) {
    const auto before = figures();
    {
        const auto device = open_hip_device(0);
        EXPECT_EQ(figures().modules, before.modules + 1);
        EXPECT_EQ(figures().streams, before.streams + 1);
    }
    EXPECT_EQ(figures().modules, before.modules);
    EXPECT_EQ(figures().streams, before.streams);
}

TEST_F(HipStandIn, TreesAndHitsAreTheHosts) {
    const Model scene = scene_of(random_soup(3000, 5, 0.3f), "soup");
    const Bvh wanted = build_bvh(scene.mesh(), {.builder = Builder::karras});
    const auto rays = make_mixed_rays(scene, 3000, 11);
    const auto n = static_cast<std::uint32_t>(rays.size());
    const std::vector<Hit> expected = trace(wanted, rays);
    for (std::size_t k = 0; k < architectures().size(); ++k) {
        const std::string selector = "hip:" + std::to_string(k);
        SCOPED_TRACE(selector);
        select_device(k == 0 ? "hip" : selector);
        EXPECT_EQ(selected_device(), selector);
        const auto launches = figures().launches;
        const Uploaded input(scene.mesh());
        for (const Builder builder : {Builder::karras, Builder::apetrei}) {
            const BuildOptions options{.builder = builder};
            DeviceBvh tree(input.kind(), input.count(), options, true);
            tree.build(input.mesh);
            EXPECT_EQ(tree_hash(tree.download()), tree_hash(wanted));
        }
        const DeviceCwbvh tree{Cwbvh(wanted)};
        const DeviceBuffer<Ray> there{std::span<const Ray>(rays)};
        const DeviceBuffer<TreeHit> found(n);
        trace_on_device(tree.tree(), there.data(), n, found.data(), CwbvhKernel::cwbvh, {},
                        nullptr);
        std::vector<TreeHit> hits(n);
        found.download(hits);
        std::uint32_t different = 0;
        for (std::uint32_t i = 0; i < n; ++i)
            different += std::memcmp(&hits[i], &expected[i], sizeof(TreeHit)) != 0;
        EXPECT_EQ(different, 0u);
        EXPECT_GT(figures().launches, launches + 20);
    }
}

/// On a stream of the caller's nothing waits, and it need not be the device's own.
TEST_F(HipStandIn, StreamsAreTheCallers) {
    select_device("hip");
    HipStream mine = nullptr;
    ASSERT_EQ(hip_api().StreamCreateWithFlags(&mine, hip_stream_non_blocking), hip_success);
    const Model scene = scene_of(random_soup(500, 6, 0.3f), "soup");
    const Uploaded input(scene.mesh());
    const BuildOptions options{.builder = Builder::karras};
    DeviceBvh tree(input.kind(), input.count(), options, true);
    fail("hipStreamSynchronize", 719);
    tree.build(input.mesh, mine);  // would throw if it waited
    EXPECT_NE(fault<DeviceError>([&] { synchronize(mine); }).find("unspecified launch failure"),
              std::string::npos);
    heal();
    synchronize(mine);
    EXPECT_EQ(tree_hash(tree.download()), tree_hash(build_bvh(scene.mesh(), options)));
    EXPECT_EQ(hip_api().StreamDestroy(mine), hip_success);
}

/// A tree in the kernels' form may be traced on another stream at once.
TEST_F(HipStandIn, ATreeIsWholeWhenItIsMade) {
    select_device("hip");
    const Model scene = scene_of(random_soup(500, 6, 0.3f), "soup");
    const Uploaded input(scene.mesh());
    DeviceBvh tree(input.kind(), input.count(), {.builder = Builder::karras}, true);
    tree.build(input.mesh);
    fail("hipStreamSynchronize", 719, 1);  // the first wait is for the counts
    EXPECT_NE(fault<DeviceError>([&] { DeviceWarpTree(tree.tree()); }), "");
}

/// Copies that were put on a stream end before the memory that they write is freed.
TEST_F(HipStandIn, ACopyThatFailsWaitsForThoseBefore) {
    select_device("hip");
    const std::vector<std::uint32_t> values(1000, 7);
    const DeviceBuffer<std::uint32_t> there{std::span<const std::uint32_t>(values)};
    Buffer<std::uint32_t> first, second;
    fetch(first, there.data(), values.size(), nullptr);
    auto waits = figures().waits;
    EXPECT_THROW(fetch(second, there.data(), std::size_t{1} << 60, nullptr), std::bad_alloc);
    EXPECT_EQ(figures().waits, waits + 1);
    fail("hipMemcpyAsync", 719);
    EXPECT_THROW(fetch(second, there.data(), values.size(), nullptr), DeviceError);
    EXPECT_EQ(figures().waits, waits + 2);
}

TEST_F(HipStandIn, CallsThatFailSayWhichAndLeaveNothing) {
    select_device("hip");
    const Model scene = scene_of(random_soup(500, 7, 0.3f), "soup");
    const auto before = figures();
    const BuildOptions options{.builder = Builder::karras};
    const auto build = [&] {
        const Uploaded input(scene.mesh());
        DeviceBvh tree(input.kind(), input.count(), options, true);
        tree.build(input.mesh);
        return tree_hash(tree.download());
    };
    for (const char* call :
         {"hipMalloc", "hipMemcpyAsync", "hipModuleLaunchKernel", "hipStreamSynchronize"})
        for (int after = 0; after < 4; ++after) {
            fail(call, 719, after);
            const std::string told = fault<DeviceError>([&] { static_cast<void>(build()); });
            heal();
            if (told.empty() && after > 1) continue;  // there may be no more such calls
            EXPECT_TRUE(told.starts_with(call)) << told;
            EXPECT_TRUE(told.ends_with("unspecified launch failure (719)")) << told;
            EXPECT_EQ(figures().allocations, before.allocations) << call << " after " << after;
        }
    EXPECT_EQ(build(), tree_hash(build_bvh(scene.mesh(), options)));
    fail("hipMalloc", 2);
    EXPECT_NE(fault<DeviceError>([&] { static_cast<void>(build()); }).find("bytes: out of memory"),
              std::string::npos);
}

/// Each kernel that the library can launch, for each architecture that it embeds.
TEST_F(HipStandIn, KernelsOfAllModulesAreInTheCodeObjects) {
    for (std::uint32_t k = 0; k < architectures().size(); ++k) {
        const auto device = open_hip_device(k);
        EXPECT_EQ(figures().kernels_of_module, figures().kernels_of_spirv);
    }
    EXPECT_GT(figures().kernels_of_spirv, 150u);
    EXPECT_FALSE(code_object(architectures()[0]).empty());
    EXPECT_TRUE(code_object("gfx90").empty());
}

/// A launch that does not fit what the code object says of its kernel is refused.
TEST_F(HipStandIn, LaunchesFitTheirKernels) {
    const auto device = open_hip_device(0);
    const Stream queue = device->queue(nullptr);
    const std::uint32_t words[64] = {};
    const auto launch = [&](const char* kernel, std::size_t groups, std::size_t threads,
                            std::size_t bytes) {
        return fault<DeviceError>([&] {
            device->launch(queue, {"sort", kernel}, groups, threads, words, bytes);
        });
    };
    EXPECT_EQ(launch("each_nothing", 1, 64, 16),
              "hipModuleGetFunction of each_nothing: named symbol not found (500)");
    EXPECT_EQ(launch("each_compute_cases", 1, 128, 12),
              "hipModuleLaunchKernel of each_compute_cases: invalid argument (1)");
    EXPECT_EQ(launch("each_compute_cases", 1, 256, 16),
              "hipModuleLaunchKernel of each_compute_cases: invalid configuration argument (9)");
    EXPECT_EQ(launch("each_compute_cases", std::size_t{1} << 26, 128, 16),
              "hipModuleLaunchKernel of each_compute_cases: invalid configuration argument (9)");
    EXPECT_EQ(launch("each_compute_cases", 1, 128, 16), "");  // of no case
    device->finish(queue);
}

}  // namespace
}  // namespace raydix::test
