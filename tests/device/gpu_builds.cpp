// Trees built on a device by the public calls of raydix/device.h against those that the host
// builds: the same hash for every kind of tree, builder, fit, code length and kind of input; on a
// stream of the caller's; rebuilt in place; never more memory touched than was lent. Skipped where
// there is no device.
#include <gtest/gtest.h>
#include <raydix/check.h>
#include <raydix/device_trees.h>
#include <raydix/error.h>
#include <raydix/model.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "device/device_test.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr Builder builders[] = {Builder::karras, Builder::lauterbach, Builder::garanzha,
                                Builder::apetrei, Builder::hploc};

/// What the host builds: one tree for the LBVH family, which karras gives the soonest.
BuildOptions host_options(BuildOptions options) {
    if (options.builder != Builder::hploc) options.builder = Builder::karras;
    options.fit = Fit::as_published;
    return options;
}

class GpuBuild : public DeviceTest {};

std::string told(const BuildOptions& o) {
    return std::string(builder_name(o.builder)) + ", " + std::to_string(o.bits) +
           " bits, leaves of " + std::to_string(o.max_leaf) + ", fit " +
           std::to_string(static_cast<int>(o.fit));
}

void expect_same(const Bvh& built, const Bvh& expected) {
    ASSERT_EQ(check_same(built, expected).broken, "");
    EXPECT_EQ(check(built).broken, "");
    EXPECT_EQ(tree_hash(built), tree_hash(expected));
    EXPECT_EQ(built.left_out(), expected.left_out());
    EXPECT_EQ(built.max_depth(), expected.max_depth());
}

void compare_bvh(const std::string& what, const MeshView& mesh, const Uploaded& input) {
    for (const int bits : {30, 63})
        for (const int max_leaf : {1, 4})
            for (const Builder builder : builders) {
                BuildOptions options{.builder = builder, .bits = bits, .max_leaf = max_leaf};
                const Bvh expected = build_bvh(mesh, host_options(options));
                for (const Fit fit : {Fit::as_published, Fit::levels, Fit::atomic}) {
                    options.fit = fit;
                    SCOPED_TRACE(what + ": " + told(options));
                    DeviceBvh tree(input.kind(), input.count(), options, true);
                    for (int turn = 0; turn < 3; ++turn) {  // again into the same memory
                        tree.build(input.mesh);
                        expect_same(tree.download(), expected);
                    }
                }
            }
}

template <class T>
bool same_bytes(std::span<const T> a, std::span<const T> b) {
    return a.size() == b.size() &&
           (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

void compare_kdtree(const std::string& what, const MeshView& mesh, const Uploaded& input) {
    for (const int bits : {30, 63})
        for (const int max_leaf : {0, 1}) {
            SCOPED_TRACE(what + ": k-d tree, " + std::to_string(bits) + " bits");
            const KdTreeOptions options{.bits = bits, .max_leaf = max_leaf};
            const KdTree expected = build_kdtree(mesh, options);
            DeviceKdTree tree(input.kind(), input.count(), options);
            for (int turn = 0; turn < 3; ++turn) {
                tree.build(input.mesh);
                const KdTree built = tree.download();
                EXPECT_EQ(kd_hash(built), kd_hash(expected));
                EXPECT_TRUE(same_bytes(built.nodes(), expected.nodes()));
                EXPECT_EQ(kd_check(built).broken, "");
                EXPECT_EQ(built.left_out(), expected.left_out());
            }
        }
}

void compare_octree(const std::string& what, const MeshView& mesh, const Uploaded& input) {
    for (const int bits : {30, 63})
        for (const int max_leaf : {1, 4}) {
            SCOPED_TRACE(what + ": octree, " + std::to_string(bits) + " bits");
            const OctreeOptions options{.bits = bits, .max_leaf = max_leaf};
            const Octree expected = build_octree(mesh, options);
            const auto nodes = static_cast<std::uint32_t>(expected.nodes().size());
            DeviceOctree tree(input.kind(), input.count(), options, std::max(nodes, 1u));
            for (int turn = 0; turn < 3; ++turn) {
                tree.build(input.mesh);
                EXPECT_EQ(tree.node_count(), nodes);
                const Octree built = tree.download();
                EXPECT_EQ(tree_hash(built), tree_hash(expected));
                EXPECT_TRUE(same_bytes(built.nodes(), expected.nodes()));
                EXPECT_EQ(check(built).broken, "");
                EXPECT_EQ(built.left_out(), expected.left_out());
            }
        }
}

/// All trees of a mesh.
void compare(const std::string& what, const MeshView& mesh) {
    const Uploaded input(mesh);
    compare_bvh(what, mesh, input);
    compare_kdtree(what, mesh, input);
    compare_octree(what, mesh, input);
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
    for (const Model& scene : builtin_triangle_scenes(200'000)) compare(scene.name, scene.mesh());
    const Model lidar = load_model("builtin:lidar");
    compare(lidar.name, lidar.mesh());
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
        expect_same(tree.download(),
                    build_bvh(std::span<const Aabb>(boxes), host_options(options)));
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

bool guard_is_whole(const DeviceBuffer<std::byte>& scratch, const std::vector<std::byte>& pattern,
                    std::size_t guard) {
    std::vector<std::byte> after(pattern.size());
    scratch.download(after);
    const auto behind = static_cast<std::ptrdiff_t>(guard);
    return std::equal(after.end() - behind, after.end(), pattern.end() - behind);
}

TEST_F(GpuBuild, WritesNothingBehindTheScratchOfCoreTrees) {
    const Mesh mesh = laced(random_soup(10'000, 3), 9);
    const Uploaded input(mesh);
    constexpr std::size_t guard = 4096;
    constexpr std::uint32_t n = 10'000, room = 50'000;
    DeviceBuffer<std::uint32_t> order(n);
    DeviceBuffer<LeafTriangle> copies(n);
    DeviceBuffer<Vec3> points(n);
    for (const int bits : {30, 63}) {
        const KdTreeOptions kd{.bits = bits};
        const std::size_t kd_bytes = device_scratch_bytes(n, PrimitiveKind::triangles, kd);
        const std::vector<std::byte> pattern(kd_bytes + guard, std::byte{0x5A});
        DeviceBuffer<std::byte> scratch{std::span<const std::byte>(pattern)};
        DeviceBuffer<KdNode> nodes(device_node_capacity(n, PrimitiveKind::triangles, kd));
        DeviceBuffer<DeviceCounts> counts(1);
        const DeviceKdArrays kd_tree{nodes.data(), order.data(), copies.data(), nullptr,
                                     counts.data()};
        build_kdtree_on_device(input.mesh, kd, kd_tree, {scratch.data(), kd_bytes}, nullptr);
        EXPECT_EQ(kd_hash(download_kdtree(kd_tree, PrimitiveKind::triangles, kd, nullptr)),
                  kd_hash(build_kdtree(mesh, kd)));
        EXPECT_TRUE(guard_is_whole(scratch, pattern, guard));
        EXPECT_THROW(build_kdtree_on_device(input.mesh, kd, kd_tree, {scratch.data(), kd_bytes / 2},
                                            nullptr),
                     InputError);

        const OctreeOptions oct{.bits = bits};
        const std::size_t oct_bytes = device_scratch_bytes(n, room, oct);
        const std::vector<std::byte> oct_pattern(oct_bytes + guard, std::byte{0x5A});
        DeviceBuffer<std::byte> oct_scratch{std::span<const std::byte>(oct_pattern)};
        DeviceBuffer<OctreeNode> oct_nodes(room);
        DeviceBuffer<DeviceOctreeCounts> oct_counts(1);
        DeviceOctreeArrays oct_tree{oct_nodes.data(), room, order.data(), points.data(),
                                    oct_counts.data()};
        build_octree_on_device(input.mesh, oct, oct_tree, {oct_scratch.data(), oct_bytes}, nullptr);
        EXPECT_EQ(tree_hash(download_octree(oct_tree, PrimitiveKind::triangles, oct, nullptr)),
                  tree_hash(build_octree(mesh, oct)));
        EXPECT_TRUE(guard_is_whole(oct_scratch, oct_pattern, guard));
        oct_tree.node_capacity = 10;  // too little room: a clear error, nothing written beyond it
        build_octree_on_device(input.mesh, oct, oct_tree, {oct_scratch.data(), oct_bytes}, nullptr);
        EXPECT_THROW(
            static_cast<void>(download_octree(oct_tree, PrimitiveKind::triangles, oct, nullptr)),
            InputError);
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
                        build_bvh(mesh, host_options(options)));
            EXPECT_TRUE(guard_is_whole(scratch, pattern, guard)) << told(options);
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
