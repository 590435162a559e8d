// k-d tree and octree as a GPU builds them (gpu/device_trees.h), run on the host: by its loops, and
// in shuffled order on real threads. Every node is that of build_kdtree and build_octree, for input
// that the host does not look at.
#include "gpu/device_trees.h"

#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/model.h>

#include <cmath>
#include <cstring>

#include "support/launched_core.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

struct Case {
    std::string name;
    Mesh mesh;
};

Mesh points_only(std::vector<Vec3> points) {
    Mesh mesh;
    mesh.vertices = std::move(points);
    return mesh;
}

std::vector<Case> cases() {
    std::vector<Case> all;
    for (std::size_t n = 0; n <= 9; n += sanitized && n > 2 ? 3 : 1) {
        all.push_back({std::to_string(n) + " triangles", random_soup(n, n + 1)});
        Mesh points = points_only(random_soup(n, n + 3).vertices);
        points.vertices.resize(n);
        all.push_back({std::to_string(n) + " points", std::move(points)});
        if (n != 0)
            all.push_back(
                {std::to_string(n) + " triangles, some left out", laced(random_soup(n, n + 1), 4)});
    }
    all.push_back({"soup", random_soup(40 * thorough + 60, 3)});
    all.push_back({"soup with NaN", laced(random_soup(40 * thorough + 60, 3), 5)});
    all.push_back({"nothing valid", laced(random_soup(50, 3), 1)});
    all.push_back({"lattice", lattice_mesh(fewer(300, 3), 3, 9)});
    all.push_back(
        {"equal points", points_only(std::vector<Vec3>(fewer(500, 4), Vec3{-0.0f, 0, 5}))});
    std::vector<Vec3> doubled = random_soup(60, 7).vertices;
    for (std::size_t i = 0; i < doubled.size(); i += 2) doubled[i] = doubled[i % 22];
    doubled[5].x = 3e12f;
    all.push_back({"points, many equal, one left out", points_only(doubled)});
    return all;
}

template <class T>
bool same_bytes(std::span<const T> a, std::span<const T> b) {
    return a.size() == b.size() &&
           (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}
template <class Tree>
void expect_same_input_counts(const Tree& built, const Tree& expected) {
    EXPECT_EQ(built.input_count(), expected.input_count());
    EXPECT_EQ(built.left_out(), expected.left_out());
    const Aabb a = built.bounds(), b = expected.bounds();
    EXPECT_EQ(std::memcmp(&a, &b, sizeof(a)), 0);
    EXPECT_TRUE(same_bytes(built.order(), expected.order()));
    EXPECT_TRUE(same_bytes(built.points(), expected.points()));
    EXPECT_EQ(built.options().max_leaf, expected.options().max_leaf);
}

void expect_same(const KdTree& built, const KdTree& expected) {
    expect_same_input_counts(built, expected);
    EXPECT_EQ(kd_hash(built), kd_hash(expected));
    EXPECT_TRUE(same_bytes(built.nodes(), expected.nodes()));
    EXPECT_TRUE(same_bytes(built.triangles(), expected.triangles()));
    EXPECT_EQ(built.max_depth(), expected.max_depth());
    EXPECT_EQ(kd_check(built).broken, "");
}

void expect_same(const Octree& built, const Octree& expected) {
    expect_same_input_counts(built, expected);
    EXPECT_EQ(tree_hash(built), tree_hash(expected));
    EXPECT_TRUE(same_bytes(built.nodes(), expected.nodes()));
    ASSERT_EQ(built.level_count(), expected.level_count());
    for (std::uint32_t level = 0; level <= 23; ++level)
        EXPECT_EQ(built.level_nodes(level).begin, expected.level_nodes(level).begin) << level;
    EXPECT_EQ(check(built).broken, "");
}

TEST(DeviceCore, KdTreeIsThatOfTheHost) {
    std::uint64_t seed = 1;
    for (const Case& c : cases())
        for (const int bits : {30, 63})
            for (const int max_leaf : {0, 1, 3, 255}) {
                const KdTreeOptions options{.bits = bits, .max_leaf = max_leaf};
                SCOPED_TRACE(c.name + ", " + std::to_string(bits) + " bits, leaves of " +
                             std::to_string(max_leaf) + ", seed " + std::to_string(++seed));
                const KdTree expected = build_kdtree(c.mesh, options);
                HostLauncher<> host;
                expect_same(launched_kdtree(host, c.mesh, options), expected);
                ShuffledLauncher shuffled(seed);
                expect_same(launched_kdtree(shuffled, c.mesh, options), expected);
            }
}

TEST(DeviceCore, OctreeIsThatOfTheHost) {
    std::uint64_t seed = 1000;
    for (const Case& c : cases())
        for (const int bits : {30, 63})
            for (const int max_leaf : {1, 4, 1000})
                for (const int max_level : {-1, 0, 3}) {
                    if (thorough == 1 && max_level == 0 && max_leaf != 4) continue;
                    const OctreeOptions options{
                        .bits = bits, .max_level = max_level, .max_leaf = max_leaf};
                    SCOPED_TRACE(c.name + ", " + std::to_string(bits) + " bits, leaves of " +
                                 std::to_string(max_leaf) + ", level " + std::to_string(max_level) +
                                 ", seed " + std::to_string(++seed));
                    const Octree expected = build_octree(c.mesh, options);
                    HostLauncher<> host;
                    expect_same(launched_octree(host, c.mesh, options), expected);
                    ShuffledLauncher shuffled(seed);
                    expect_same(launched_octree(shuffled, c.mesh, options), expected);
                }
}

TEST(DeviceCore, AHundredOrdersGiveOneTree) {
    Mesh mesh = laced(random_soup(100 + 20 * thorough, 77), 11);
    for (std::size_t i = 0; i < 60; ++i) mesh.triangles[3 * (i % 20)] = mesh.triangles[i];
    const KdTree kdtree = build_kdtree(mesh, {.max_leaf = 2});
    const Octree octree = build_octree(mesh, {.max_leaf = 2});
    for (std::uint64_t seed = 0; seed < fewer(100, 2); ++seed) {
        ShuffledLauncher shuffled(seed);
        const KdTree kd =
            launched_kdtree(shuffled, mesh, {.max_leaf = 2}, static_cast<unsigned char>(seed));
        ASSERT_TRUE(same_bytes(kd.nodes(), kdtree.nodes())) << "seed " << seed;
        const Octree oct = launched_octree(shuffled, mesh, {.max_leaf = 2});
        ASSERT_TRUE(same_bytes(oct.nodes(), octree.nodes())) << "seed " << seed;
    }
}

TEST(DeviceCore, AnOctreeThatDoesNotFitSaysHowMuchItTakes) {
    const Mesh mesh = random_soup(400, 8);
    const OctreeOptions options{.max_leaf = 1};
    const auto needed = static_cast<std::uint32_t>(build_octree(mesh, options).nodes().size());
    for (const std::uint32_t room : {0u, 1u, needed - 1}) {
        ShuffledLauncher shuffled(room);
        const LaunchedOctree cut(shuffled, mesh, options, room);
        EXPECT_EQ(cut.counts.node_count, needed);
        OctreeNode untouched;
        std::memset(static_cast<void*>(&untouched), 0xA5, sizeof(untouched));
        for (const OctreeNode& node : cut.nodes)
            ASSERT_EQ(std::memcmp(&node, &untouched, sizeof(node)), 0);
        try {
            static_cast<void>(cut.assemble(mesh, options));
            ADD_FAILURE() << "no error";
        } catch (const InputError& error) {
            EXPECT_EQ(std::string(error.what()), "the octree has " + std::to_string(needed) +
                                                     " nodes; there is room for " +
                                                     std::to_string(room));
        }
    }
    HostLauncher<> host;
    const LaunchedOctree whole(host, mesh, options, needed);
    EXPECT_EQ(tree_hash(whole.assemble(mesh, options)), tree_hash(build_octree(mesh, options)));
}

TEST(DeviceCore, NoOctreeHasMoreNodesThanTheBound) {
    // Pairs of equal codes: each pair stays together down to the last level.
    std::vector<Vec3> pairs;
    for (const Vec3& p : random_soup(100, 5).vertices) pairs.insert(pairs.end(), {p, p});
    for (const int max_leaf : {1, 2, 4})
        for (const int max_level : {0, 1, 2, 10, 21}) {
            const OctreeOptions options{.max_level = max_level, .max_leaf = max_leaf};
            const Octree octree = build_octree(std::span<const Vec3>(pairs), options);
            EXPECT_LE(octree.nodes().size(),
                      device_node_bound(static_cast<std::uint32_t>(pairs.size()), options));
        }
    EXPECT_EQ(device_node_bound(0, {}), 0u);
    EXPECT_EQ(device_node_bound(1, {}), 1u);
}

TEST(DeviceCore, WhatIsWrongWithTheDataIsToldAfterwards) {
    Mesh mesh = random_soup(50, 4);
    mesh.vertices[3 * 40].x = infinity;
    HostLauncher<> host;
    EXPECT_NO_THROW(static_cast<void>(launched_kdtree(host, mesh, {})));
    EXPECT_THROW(static_cast<void>(launched_kdtree(host, mesh, {.strict = true})), InputError);
    EXPECT_THROW(static_cast<void>(launched_octree(host, mesh, {.strict = true})), InputError);
    mesh.triangles[17][2] = 150;
    EXPECT_THROW(static_cast<void>(launched_kdtree(host, mesh, {})), InputError);
    EXPECT_THROW(static_cast<void>(launched_octree(host, mesh, {})), InputError);
}

TEST(DeviceCore, OptionsOutOfRangeAreNamed) {
    EXPECT_THROW(static_cast<void>(device_node_capacity(3, PrimitiveKind::points, {.bits = 31})),
                 InputError);
    EXPECT_THROW(
        static_cast<void>(device_node_capacity(3, PrimitiveKind::points, {.max_leaf = 256})),
        InputError);
    EXPECT_THROW(static_cast<void>(
                     device_node_capacity(0x7FFFFFFFu, PrimitiveKind::points, {.max_leaf = 1})),
                 InputError);  // more inner nodes than a link can name
    EXPECT_THROW(static_cast<void>(device_node_bound(3, {.max_leaf = 0})), InputError);
    EXPECT_THROW(static_cast<void>(device_node_bound(1u << 28, {})), InputError);
}

TEST(DeviceCore, WithoutADeviceEveryCallSaysSo) {
    if (device_available()) GTEST_SKIP() << "there is a device: " << device_name();
    EXPECT_THROW(DeviceKdTree(PrimitiveKind::points, 10, {}), BackendUnavailable);
    EXPECT_THROW(DeviceOctree(PrimitiveKind::points, 10, {}), BackendUnavailable);
    EXPECT_THROW(
        static_cast<void>(device_scratch_bytes(10, PrimitiveKind::points, KdTreeOptions())),
        BackendUnavailable);
    EXPECT_THROW(static_cast<void>(device_scratch_bytes(10, 20, OctreeOptions())),
                 BackendUnavailable);
}

}  // namespace
}  // namespace raydix::test
