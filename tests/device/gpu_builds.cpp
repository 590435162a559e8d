// Trees built on a device by the public calls of raydix/device.h against those that the host
// builds: the same hash for every builder, fit, code length and kind of input; on a stream of the
// caller's; rebuilt in place; never more memory touched than was lent. Skipped where there is no
// device.
#include <gtest/gtest.h>
#include <raydix/check.h>
#include <raydix/device.h>
#include <raydix/error.h>
#include <raydix/scene.h>

#include <cmath>
#include <cstring>

#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr Builder builders[] = {Builder::karras, Builder::lauterbach, Builder::garanzha,
                                Builder::apetrei};

class GpuBuild : public ::testing::Test {
protected:
    void SetUp() override {
        try {
            static_cast<void>(device_name());
        } catch (const BackendUnavailable& reason) {
            GTEST_SKIP() << reason.what();
        }
    }
};

std::string told(const BuildOptions& o) {
    return std::string(builder_name(o.builder)) + ", " + std::to_string(o.bits) +
           " bits, leaves of " + std::to_string(o.max_leaf) + ", fit " +
           std::to_string(static_cast<int>(o.fit));
}

/// A mesh on the device.
struct Uploaded {
    DeviceBuffer<Vec3> vertices;
    DeviceBuffer<Triangle> triangles;
    DeviceMesh mesh;

    explicit Uploaded(const MeshView& view) : vertices(view.vertices), triangles(view.triangles) {
        mesh = {vertices.data(), static_cast<std::uint32_t>(vertices.size()), triangles.data(),
                static_cast<std::uint32_t>(triangles.size())};
    }
    [[nodiscard]] PrimitiveKind kind() const {
        return mesh.triangle_count != 0 ? PrimitiveKind::triangles : PrimitiveKind::points;
    }
    [[nodiscard]] std::uint32_t count() const {
        return mesh.triangle_count != 0 ? mesh.triangle_count : mesh.vertex_count;
    }
};

void expect_same(const Bvh& built, const Bvh& expected) {
    ASSERT_EQ(check_same(built, expected).broken, "");
    EXPECT_EQ(check(built).broken, "");
    EXPECT_EQ(tree_hash(built), tree_hash(expected));
    EXPECT_EQ(built.left_out(), expected.left_out());
    EXPECT_EQ(built.max_depth(), expected.max_depth());
}

void compare(const std::string& what, const MeshView& mesh) {
    const Uploaded input(mesh);
    for (const int bits : {30, 63})
        for (const int max_leaf : {1, 4}) {
            const Bvh expected = build_bvh(mesh, {.bits = bits, .max_leaf = max_leaf});
            for (const Builder builder : builders)
                for (const Fit fit : {Fit::as_published, Fit::levels, Fit::atomic}) {
                    const BuildOptions options{
                        .builder = builder, .bits = bits, .max_leaf = max_leaf, .fit = fit};
                    SCOPED_TRACE(what + ": " + told(options));
                    DeviceBvh tree(input.kind(), input.count(), options, true);
                    for (int turn = 0; turn < 3; ++turn) {  // again into the same memory
                        tree.build(input.mesh);
                        expect_same(tree.download(), expected);
                    }
                }
        }
}

/// Every k-th vertex is NaN.
Mesh laced(Mesh mesh, std::size_t k) {
    for (std::size_t i = 0; i < mesh.vertices.size(); i += k) mesh.vertices[i].y = std::nanf("");
    return mesh;
}

TEST_F(GpuBuild, FewPrimitives) {
    for (std::size_t n = 0; n <= 9; ++n) {
        const Mesh mesh = random_soup(n, n + 1);
        compare(std::to_string(n) + " triangles", mesh);
        compare(std::to_string(n) + " points", MeshView(mesh.vertices, {}));
        if (n != 0) compare(std::to_string(n) + " triangles, some left out", laced(mesh, 4));
    }
}

TEST_F(GpuBuild, EachBuiltinScene) {
    for (const Scene& scene : builtin_triangle_scenes(200'000)) compare(scene.name, scene.mesh);
    const Scene lidar = load_scene("builtin:lidar");
    compare(lidar.name, lidar.mesh);
}

TEST_F(GpuBuild, DegenerateInput) {
    compare("soup with NaN", laced(random_soup(100'000, 6), 7));
    compare("nothing valid", laced(random_soup(1000, 6), 1));
    compare("lattice", lattice_mesh(50'000, 4, 8));
    const std::vector<Vec3> equal(1'000'000, Vec3{-0.0f, 0, 5});
    compare("equal points", MeshView(equal, {}));
}

TEST_F(GpuBuild, Boxes) {
    const Mesh soup = random_soup(30'000, 12);
    std::vector<Aabb> boxes;
    for (const Triangle& t : soup.triangles) {
        const Vec3 lo = soup.vertices[t[0]];
        boxes.push_back({lo, {lo.x + 0.1f, lo.y, lo.z + 0.01f}});
    }
    boxes[77] = {{1, 1, 1}, {0, 2, 2}};
    const DeviceBuffer<Aabb> input{std::span<const Aabb>(boxes)};
    for (const Builder builder : builders) {
        const BuildOptions options{.builder = builder};
        DeviceBvh tree(PrimitiveKind::boxes, 40'000, options);
        tree.build(DeviceBoxList{input.data(), static_cast<std::uint32_t>(boxes.size())});
        expect_same(tree.download(), build_bvh(std::span<const Aabb>(boxes)));
    }
}

TEST_F(GpuBuild, ASmallerMeshIntoTheMemoryOfALargerOne) {
    DeviceBvh tree(PrimitiveKind::triangles, 50'000, {}, true);
    for (const std::size_t n : {50'000u, 3u, 20'000u, 1u}) {
        const Mesh mesh = random_soup(n, n);
        const Uploaded input(mesh);
        tree.build(input.mesh);
        expect_same(tree.download(), build_bvh(mesh));
    }
}

TEST_F(GpuBuild, WritesNothingBehindTheScratch) {
    const Mesh mesh = random_soup(10'000, 3);
    const Uploaded input(mesh);
    for (const Builder builder : builders)
        for (const int bits : {30, 63}) {
            const BuildOptions options{.builder = builder, .bits = bits};
            const std::size_t bytes = device_scratch_bytes(10'000, options), guard = 4096;
            const std::vector<std::byte> pattern(bytes + guard, std::byte{0x5A});
            DeviceBuffer<std::byte> scratch{std::span<const std::byte>(pattern)};
            DeviceBuffer<BvhNode> nodes(device_node_capacity(10'000, options));
            DeviceBuffer<std::uint32_t> order(10'000);
            DeviceBuffer<LeafTriangle> copies(10'000);
            DeviceBuffer<DeviceCounts> counts(1);
            DeviceTree tree;
            tree.nodes = nodes.data();
            tree.order = order.data();
            tree.triangles = copies.data();
            tree.counts = counts.data();
            build_bvh_on_device(input.mesh, options, tree, {scratch.data(), bytes}, nullptr);
            expect_same(download_bvh(tree, PrimitiveKind::triangles, options, nullptr),
                        build_bvh(mesh, {.bits = bits}));
            std::vector<std::byte> after(bytes + guard);
            scratch.download(after);
            EXPECT_TRUE(std::equal(after.end() - guard, after.end(), pattern.end() - guard))
                << told(options);
            EXPECT_THROW(build_bvh_on_device(input.mesh, options, tree, {scratch.data(), bytes / 2},
                                             nullptr),
                         InputError);
        }
}

TEST_F(GpuBuild, WhatIsWrongWithTheDataIsFoundOnTheDevice) {
    Mesh mesh = random_soup(5000, 4);
    mesh.vertices[3 * 4000].x = infinity;
    DeviceBvh tree(PrimitiveKind::triangles, 5000, {.strict = true});
    const Uploaded infinite(mesh);
    tree.build(infinite.mesh);
    EXPECT_THROW(static_cast<void>(tree.download()), InputError);
    mesh.triangles[1700][2] = 15'000;
    DeviceBvh loose(PrimitiveKind::triangles, 5000, {});
    const Uploaded unreadable(mesh);
    loose.build(unreadable.mesh);
    EXPECT_THROW(static_cast<void>(loose.download()), InputError);
}

}  // namespace
}  // namespace raydix::test
