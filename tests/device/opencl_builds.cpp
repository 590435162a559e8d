// Builds on an OpenCL device against those of the host: the arithmetic first, then every builder,
// code length and fit for inputs of all kinds, sizes around those of warps, tiles and groups,
// scratch of exactly the asked size between guards of garbage, and two queues at once. Skipped with
// the reason where there is no such device.
#include <gtest/gtest.h>
#include <raydix/check.h>
#include <raydix/device_trees.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iostream>
#include <limits>
#include <numeric>
#include <random>
#include <thread>

#include "device/device_test.h"
#include "exec/arithmetic_check.h"
#include "exec/opencl_device.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr Builder builders[] = {Builder::karras, Builder::lauterbach, Builder::garanzha,
                                Builder::apetrei, Builder::hploc};

class OpenclBuild : public DeviceTest {};

std::string told(const BuildOptions& o) {
    return std::string(builder_name(o.builder)) + ", " + std::to_string(o.bits) + " bits, fit " +
           std::to_string(static_cast<int>(o.fit));
}

std::string expected_hash(const MeshView& mesh, BuildOptions options) {
    if (options.builder != Builder::hploc) options.builder = Builder::karras;
    options.fit = Fit::as_published;
    return tree_hash(build_bvh(mesh, options));
}

/// All builders, code lengths and fits; or the fit as published alone.
void compare(const std::string& what, const MeshView& mesh, bool all_fits) {
    const Uploaded input(mesh);
    for (const Builder builder : builders)
        for (const int bits : {30, 63})
            for (const Fit fit : {Fit::as_published, Fit::levels, Fit::atomic}) {
                if (fit != Fit::as_published && !all_fits) continue;
                const BuildOptions options{.builder = builder, .bits = bits, .fit = fit};
                SCOPED_TRACE(what + ": " + told(options));
                DeviceBvh tree(input.kind(), input.count(), options, true);
                for (int turn = 0; turn < 2; ++turn) {  // again into the same memory
                    tree.build(input.mesh);
                    const Bvh built = tree.download();
                    EXPECT_EQ(tree_hash(built), expected_hash(mesh, options));
                    EXPECT_EQ(check(built).broken, "");
                }
            }
    for (const int bits : {30, 63}) {
        SCOPED_TRACE(what + ", " + std::to_string(bits) + " bits");
        const KdTreeOptions kd_options{.bits = bits};
        DeviceKdTree kd(input.kind(), input.count(), kd_options);
        kd.build(input.mesh);
        EXPECT_EQ(kd_hash(kd.download()), kd_hash(build_kdtree(mesh, kd_options)));
        const OctreeOptions octree_options{.bits = bits};
        const Octree expected = build_octree(mesh, octree_options);
        DeviceOctree octree(
            input.kind(), input.count(), octree_options,
            std::max<std::uint32_t>(1, static_cast<std::uint32_t>(expected.nodes().size())));
        octree.build(input.mesh);
        EXPECT_EQ(tree_hash(octree.download()), tree_hash(expected));
    }
}

TEST_F(OpenclBuild, ArithmeticIsTheHosts) {
    // select_device has compared every case; here is what it would say of a device that is not so.
    std::vector<ArithmeticResults> results(arithmetic_cases);
    for (std::uint32_t i = 0; i < arithmetic_cases; ++i) results[i] = compute_case(i);
    EXPECT_EQ(first_wrong_case(results), "");
    const auto next = [](float x) { return std::nextafter(x, infinity); };
    std::vector<ArithmeticResults> wrong = results;
    wrong[77].quotient = next(wrong[77].quotient);
    EXPECT_NE(first_wrong_case(wrong).find("division"), std::string::npos);
    wrong = results;
    wrong[5].root = next(wrong[5].root);
    EXPECT_NE(first_wrong_case(wrong).find("square root"), std::string::npos);
    wrong = results;  // denormals flushed
    std::size_t denormal = 0;
    for (ArithmeticResults& r : wrong)
        if (std::fpclassify(r.sum) == FP_SUBNORMAL) {
            r.sum = 0;
            ++denormal;
        }
    EXPECT_GT(denormal, 100u);
    EXPECT_NE(first_wrong_case(wrong).find("a sum"), std::string::npos);
    wrong = results;  // product and sum fused
    for (std::uint32_t i = 0; i < arithmetic_cases; ++i) {
        const ArithmeticCase c(i);
        wrong[i].product_and_sum = std::fma(c.a, c.b, c.c);
    }
    EXPECT_NE(first_wrong_case(wrong).find("apart"), std::string::npos);
}

TEST_F(OpenclBuild, ADeviceThatLacksSomethingIsNamed) {
    OpenclTraits traits = find_opencl_devices().front().traits;
    ASSERT_EQ(opencl_lacks(traits), "");
    const auto lacks = [&](const char* what, const auto& change) {
        OpenclTraits poorer = traits;
        change(poorer);
        EXPECT_NE(opencl_lacks(poorer).find(what), std::string::npos) << opencl_lacks(poorer);
    };
    lacks("fp64", [](OpenclTraits& t) { t.double_precision = 0; });
    lacks("denormal", [](OpenclTraits& t) { t.single_precision &= ~cl_ulong{CL_FP_DENORM}; });
    lacks("sub-groups of 32", [](OpenclTraits& t) { t.sub_group_sizes = {8, 16}; });
    lacks("acquire-release", [](OpenclTraits& t) { t.atomics = CL_DEVICE_ATOMIC_ORDER_RELAXED; });
    lacks("SPIR-V", [](OpenclTraits& t) { t.il_versions = "SPIR-V_1.2"; });
    lacks("cl_intel_unified_shared_memory", [](OpenclTraits& t) { t.extensions = ""; });
    lacks("generic", [](OpenclTraits& t) { t.generic_pointers = false; });
    lacks("64-bit", [](OpenclTraits& t) { t.address_bits = 32; });
}

TEST_F(OpenclBuild, OtherWordsAreRefused) {
    const std::string before = selected_device();
    EXPECT_THROW(select_device("opencl:"), InputError);
    EXPECT_THROW(select_device("opencl:x"), InputError);
    EXPECT_THROW(select_device("opencl:1x"), InputError);
    EXPECT_THROW(select_device("gpu"), InputError);
    EXPECT_THROW(select_device("opencl:4000"), BackendUnavailable);
    EXPECT_EQ(selected_device(), before);
}

TEST_F(OpenclBuild, NoBufferIsSmallerThanItSays) {
    constexpr std::size_t all = std::numeric_limits<std::size_t>::max();
    DeviceBuffer<std::uint64_t> buffer(3);
    for (const std::size_t size : {all / 8 + 2, all / 8, all, all / 2}) {
        EXPECT_THROW(buffer.reset(size), DeviceError) << size;
        EXPECT_EQ(buffer.size(), 0u);
    }
    EXPECT_THROW(DeviceBuffer<std::byte>(all - 3), DeviceError);
    buffer.reset(5);
    EXPECT_NE(buffer.data(), nullptr);
}

TEST_F(OpenclBuild, SizesAroundThoseOfWarpsTilesAndGroups) {
    for (const std::size_t n :
         {0u, 1u, 2u, 3u, 31u, 32u, 33u, 127u, 128u, 129u, 255u, 256u, 257u, 1023u, 1025u}) {
        const Mesh mesh = random_soup(n, n + 1);
        compare(std::to_string(n) + " triangles", mesh, n == 33 || n == 257);
        if (n < 64) compare(std::to_string(n) + " points", MeshView(mesh.vertices, {}), false);
    }
}

TEST_F(OpenclBuild, SortedEqualAndDegenerateInput) {
    Mesh sorted = random_soup(700, 5);
    std::ranges::sort(sorted.vertices, {}, &Vec3::x);
    compare("sorted", sorted, true);
    compare("equal points", MeshView(std::vector<Vec3>(700, Vec3{-0.0f, 0, 5}), {}), true);
    std::vector<Vec3> line(600);
    for (std::size_t i = 0; i < line.size(); ++i) line[i].x = static_cast<float>(i % 50);
    compare("points on a line", MeshView(line, {}), false);
    Mesh laced = random_soup(900, 6);
    for (std::size_t i = 0; i < laced.vertices.size(); i += 7) laced.vertices[i].y = std::nanf("");
    compare("some left out", laced, true);
    for (Vec3& v : laced.vertices) v.z = infinity;
    compare("nothing valid", laced, false);
    Mesh huge = random_soup(500, 7);
    for (Vec3& v : huge.vertices) v = {v.x * 1e11f, v.y * 1e11f, v.z * 1e11f};
    compare("huge", huge, false);
    for (Vec3& v : huge.vertices) v = {v.x * 1e-31f, v.y * 1e-31f, v.z * 1e-31f};
    compare("tiny", huge, false);
}

TEST_F(OpenclBuild, ManyTriangles) {
    for (const std::size_t n : {100'000u, 1'000'000u}) {
        const Mesh mesh = random_soup(n, 8, n > 100'000 ? 0.005f : 0.02f);
        const Uploaded input(mesh);
        for (const Builder builder : {Builder::karras, Builder::apetrei, Builder::hploc}) {
            const BuildOptions options{.builder = builder};
            DeviceBvh tree(input.kind(), input.count(), options);
            const BuildMs ms = tree.build_timed(input.mesh);
            EXPECT_EQ(tree_hash(tree.download()), expected_hash(mesh, options)) << told(options);
            if (n == 1'000'000)  // by now the driver has compiled the kernels
                std::cout << n << " triangles, " << told(options) << ": " << ms.total
                          << " ms, OpenCL on a CPU\n";
        }
    }
}

TEST_F(OpenclBuild, Boxes) {
    std::vector<Aabb> boxes;
    for (const Vec3& lo : random_soup(500, 12).vertices)
        boxes.push_back({lo, {lo.x + 0.1f, lo.y, lo.z + 0.01f}});
    boxes[77] = {{1, 1, 1}, {0, 2, 2}};
    const DeviceBuffer<Aabb> input{std::span<const Aabb>(boxes)};
    const auto n = static_cast<std::uint32_t>(boxes.size());
    for (const Builder builder : builders)
        for (const Fit fit : {Fit::as_published, Fit::levels}) {
            const BuildOptions options{.builder = builder, .fit = fit};
            DeviceBvh tree(PrimitiveKind::boxes, n, options);
            tree.build(DeviceBoxList{input.data(), n});
            BuildOptions host = options;
            host.fit = Fit::as_published;
            EXPECT_EQ(tree_hash(tree.download()),
                      tree_hash(build_bvh(std::span<const Aabb>(boxes), host)));
        }
}

TEST_F(OpenclBuild, ScratchIsUsedAsAskedAndNotBeyond) {
    constexpr std::size_t guard = 4096;
    for (const std::uint32_t n : {1u, 33u, 1500u}) {
        const Mesh mesh = random_soup(n, 3);
        const Uploaded input(mesh);
        for (const Builder builder : builders)
            for (const int bits : {30, 63}) {
                const BuildOptions options{.builder = builder, .bits = bits};
                const std::size_t bytes = device_scratch_bytes(n, options);
                const std::vector<std::byte> pattern(bytes + 2 * guard, std::byte{0x5A});
                DeviceBuffer<std::byte> scratch{std::span<const std::byte>(pattern)};
                DeviceBuffer<BvhNode> nodes(device_node_capacity(n, options));
                DeviceBuffer<std::uint32_t> order(n);
                DeviceBuffer<LeafTriangle> copies(n);
                DeviceBuffer<DeviceCounts> counts(1);
                DeviceBuffer<std::byte> pairs(64 * device_pair_capacity(n, options));
                DeviceBuffer<std::uint32_t> pair_ids(n);
                const DeviceTree tree{nodes.data(),
                                      order.data(),
                                      copies.data(),
                                      nullptr,
                                      nullptr,
                                      counts.data(),
                                      reinterpret_cast<NodePair*>(pairs.data()),
                                      pair_ids.data()};
                build_bvh_on_device(input.mesh, options, tree, {scratch.data() + guard, bytes},
                                    nullptr);
                const Bvh built = download_bvh(tree, PrimitiveKind::triangles, options, nullptr);
                EXPECT_EQ(tree_hash(built), expected_hash(mesh, options)) << told(options);
                std::vector<std::byte> after(pattern.size());
                scratch.download(after);
                const auto untouched = [](std::byte b) { return b == std::byte{0x5A}; };
                EXPECT_TRUE(std::all_of(after.begin(), after.begin() + guard, untouched));
                EXPECT_TRUE(std::all_of(after.end() - guard, after.end(), untouched));
                EXPECT_THROW(build_bvh_on_device(input.mesh, options, tree,
                                                 {scratch.data(), bytes - 1}, nullptr),
                             InputError);
            }
    }
}

/// An in-order queue of the selected device, or another.
class Queue {
public:
    explicit Queue(cl_command_queue_properties properties = 0) {
        const cl_queue_properties list[] = {CL_QUEUE_PROPERTIES, properties, 0};
        cl_int status = CL_SUCCESS;
        queue_ = opencl_api().CreateCommandQueueWithProperties(
            static_cast<cl_context>(opencl_context()),
            static_cast<cl_device_id>(opencl_device_id()), list, &status);
        opencl_try(status, "clCreateCommandQueueWithProperties");
    }
    Queue(const Queue&) = delete;
    Queue& operator=(const Queue&) = delete;
    ~Queue() { static_cast<void>(opencl_api().ReleaseCommandQueue(queue_)); }
    [[nodiscard]] Stream stream() const { return queue_; }

private:
    cl_command_queue queue_ = nullptr;
};

TEST_F(OpenclBuild, TwoQueuesAtOnce) {
    const std::string device = selected_device();
    const Mesh meshes[] = {random_soup(3000, 1), random_soup(2500, 2)};
    std::string hashes[2][5];
    const auto work = [&](int k) {
        select_device(device);
        const Queue queue;
        const Uploaded input(meshes[k]);
        for (int b = 0; b < 5; ++b) {
            DeviceBvh tree(input.kind(), input.count(), {.builder = builders[b]});
            for (int turn = 0; turn < 3; ++turn) tree.build(input.mesh, queue.stream());
            hashes[k][b] = tree_hash(tree.download(queue.stream()));
        }
    };
    std::thread other(work, 1);
    work(0);
    other.join();
    for (int k = 0; k < 2; ++k)
        for (int b = 0; b < 5; ++b)
            EXPECT_EQ(hashes[k][b], expected_hash(meshes[k], {.builder = builders[b]}));
}

TEST_F(OpenclBuild, AQueueThatIsNotInOrderIsRefused) {
    const Queue queue(CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE);
    EXPECT_THROW(synchronize(queue.stream()), InputError);
}

TEST_F(OpenclBuild, TimesAreOfTheStages) {
    const Mesh mesh = random_soup(2000, 9);
    const Uploaded input(mesh);
    DeviceBvh tree(input.kind(), input.count(), {});
    const BuildMs ms = tree.build_timed(input.mesh);
    EXPECT_GT(ms.sort, 0);
    EXPECT_GE(ms.total, ms.bounds + ms.codes + ms.sort + ms.hierarchy);
    EXPECT_GT(measure_device_copy(1 << 20, 2), 0);
}

}  // namespace
}  // namespace raydix::test
