// What a GPU runs (gpu/device_build.h), run on the host: by the host's loops, and in shuffled order
// on real threads. The tree is that of build_bvh, bit for bit, for every builder and for input that
// the host does not look at.
#include "gpu/device_build.h"

#include <gtest/gtest.h>
#include <raydix/check.h>
#include <raydix/error.h>
#include <raydix/model.h>

#include <cmath>
#include <numeric>
#include <utility>

#include "support/launched_build.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr Builder builders[] = {Builder::karras, Builder::lauterbach, Builder::garanzha,
                                Builder::apetrei, Builder::hploc};

std::string told(const BuildOptions& o) {
    return std::string(builder_name(o.builder)) + ", " + std::to_string(o.bits) +
           " bits, leaves of " + std::to_string(o.max_leaf) + ", fit " +
           std::to_string(static_cast<int>(o.fit));
}

template <class Run>
void for_all_options(const Run& run) {
    for (const Builder builder : builders)
        for (const int bits : {30, 63})
            for (const int max_leaf : {1, 4})
                for (const Fit fit : {Fit::as_published, Fit::levels, Fit::atomic}) {
                    if (sanitized && (bits == 30) != (max_leaf == 1)) continue;
                    run(BuildOptions{
                        .builder = builder, .bits = bits, .max_leaf = max_leaf, .fit = fit});
                }
}

/// Arrays, not only the tree: the pairs as kernels walk them, from pair 0 on.
void expect_pairs_hold_the_tree(const LaunchedBuild& built) {
    const DeviceCounts& counts = built.counts;
    if (counts.references == 0) return;
    std::vector<bool> seen(counts.references);
    std::vector<bool> met(counts.inner_count);  // pairs
    std::vector<std::pair<std::int32_t, BvhNode>> to_visit;
    const auto visit_child = [&](std::int32_t link, const BvhNode& node) {
        if (!node.is_leaf()) {
            to_visit.emplace_back(link, node);
            return;
        }
        ASSERT_LT(link, 0);
        std::uint32_t k = static_cast<std::uint32_t>(~link), n = 0;
        ASSERT_EQ(k, node.first);
        for (bool last = false; !last; ++k, ++n) {
            ASSERT_LT(k, counts.references);
            last = (built.pair_ids[k] & last_in_leaf) != 0;
            ASSERT_EQ(built.pair_ids[k] & ~last_in_leaf, built.order[k]);
            ASSERT_FALSE(seen[k]);
            seen[k] = true;
        }
        ASSERT_EQ(n, node.count);
    };
    if (counts.inner_count == 0) {
        const NodePair& only = built.pairs[0];
        visit_child(only.child0, built.nodes[0]);
        EXPECT_EQ(only.child1, only.child0);
        EXPECT_GT(only.c1_xlo, only.c1_xhi);
        EXPECT_GT(only.c1_zlo, only.c1_zhi);
    }
    if (counts.inner_count > 0) to_visit.emplace_back(0, built.nodes[0]);
    while (!to_visit.empty()) {
        const auto [link, node] = to_visit.back();
        to_visit.pop_back();
        ASSERT_GE(link, 0);
        const auto r = static_cast<std::uint32_t>(link);
        ASSERT_LT(r, counts.inner_count);
        ASSERT_FALSE(met[r]) << r;
        met[r] = true;
        const NodePair& pair = built.pairs[r];
        const BvhNode &a = built.nodes[node.first], &b = built.nodes[node.first + 1];
        visit_child(pair.child0, a);
        visit_child(pair.child1, b);
        const float pad = pair_padding(built.nodes[0]);
        const float expected[] = {a.lo.x - pad, a.hi.x + pad, a.lo.y - pad, a.hi.y + pad,
                                  b.lo.x - pad, b.hi.x + pad, b.lo.y - pad, b.hi.y + pad,
                                  a.lo.z - pad, a.hi.z + pad, b.lo.z - pad, b.hi.z + pad};
        ASSERT_EQ(std::memcmp(&pair.c0_xlo, expected, sizeof(expected)), 0) << r;
        ASSERT_EQ(pair.unused0 | pair.unused1, 0);
    }
    EXPECT_EQ(std::accumulate(met.begin(), met.end(), 0u), counts.inner_count);
    EXPECT_EQ(std::accumulate(seen.begin(), seen.end(), 0u), counts.references);
}

template <class Input>
void expect_same_tree(LaunchedBuild built, const Input& input, BuildOptions options) {
    if (in_lbvh_family(options.builder)) options.builder = Builder::karras;
    options.fit = Fit::as_published;
    const Bvh expected = build_bvh(input, options);
    ASSERT_EQ(check_same(built.bvh, expected).broken, "");
    ASSERT_EQ(check(built.bvh).broken, "");
    ASSERT_EQ(tree_hash(built.bvh), tree_hash(expected));
    EXPECT_EQ(built.bvh.left_out(), expected.left_out());
    EXPECT_EQ(built.bvh.max_depth(), expected.max_depth());
    EXPECT_EQ(built.bvh.inner_count(), expected.inner_count());
    if (!expected.empty()) {
        const Aabb a = built.counts.bounds, b = expected.bounds();
        EXPECT_EQ(std::memcmp(&a, &b, sizeof(a)), 0);
    }
    expect_pairs_hold_the_tree(built);
}

template <class Input>
void expect_same_everywhere(const std::string& what, const Input& input) {
    std::uint64_t seed = 1;
    for_all_options([&](const BuildOptions& options) {
        SCOPED_TRACE(what + ": " + told(options));
        HostLauncher<> host;
        expect_same_tree(launched_build(host, input, options), input, options);
        ShuffledLauncher shuffled(++seed);
        expect_same_tree(launched_build(shuffled, input, options), input, options);
    });
}

TEST(DeviceBuild, FewPrimitivesValidAndNot) {
    const float nan = std::nanf("");
    const std::size_t most = sanitized ? 2 : 10;
    for (std::size_t n = 0; n <= most; ++n) {
        const Mesh mesh = random_soup(n, n + 1);
        expect_same_everywhere(std::to_string(n) + " triangles", MeshView(mesh));
        for (std::size_t bad = 1; bad <= n; ++bad) {
            if (bad > 5 && bad + 3 < n) continue;
            Mesh some = mesh;
            for (std::size_t i = 0; i < bad; ++i) some.vertices[3 * ((7 * i) % n) + 1].z = nan;
            SCOPED_TRACE(std::to_string(bad) + " of " + std::to_string(n) + " left out");
            expect_same_everywhere("with NaN", MeshView(some));
        }
    }
}

TEST(DeviceBuild, Triangles) {
    constexpr std::size_t count = fewer(700, 7);
    const Mesh soup = random_soup(count, 3);
    expect_same_everywhere("soup", MeshView(soup));
    expect_same_everywhere("soup with NaN", MeshView(laced(soup, 5)));
    expect_same_everywhere("nothing valid", MeshView(laced(soup, 1)));
    expect_same_everywhere("lattice", MeshView(lattice_mesh(count, 3, 9)));
}

TEST(DeviceBuild, PointsAndBoxes) {
    constexpr std::size_t count = fewer(200, 5);
    std::vector<Vec3> points(3 * count / 2, Vec3{1, 2, 3});
    for (std::size_t i = 0; i < count; ++i) points.push_back(random_soup(1, i).vertices[0]);
    points.push_back({-0.0f, 1, -0.0f});
    expect_same_everywhere("points", MeshView(points, {}));
    points[7].x = infinity;
    points[2 * count].x = 3e12f;
    expect_same_everywhere("points, some left out", MeshView(points, {}));
    const std::vector<Vec3> equal(5 * count, Vec3{-0.0f, 0, 5});
    expect_same_everywhere("equal points", MeshView(equal, {}));

    std::vector<Aabb> boxes;
    for (std::size_t i = 0; i + 1 < points.size(); ++i)
        boxes.push_back({points[i], {points[i].x + 0.1f, points[i].y, points[i].z + 0.2f}});
    boxes[3] = {{1, 1, 1}, {0, 2, 2}};
    expect_same_everywhere("boxes", std::span<const Aabb>(boxes));
}

TEST(DeviceBuild, EachBuiltinScene) {
    std::uint64_t seed = 100;
    for (const Model& scene : builtin_triangle_scenes(100 * thorough)) {
        for (const Builder builder : builders)
            for (const int bits : {30, 63}) {
                if (++seed % 3 != 0 && sanitized) continue;
                const BuildOptions options{.builder = builder, .bits = bits};
                SCOPED_TRACE(scene.name + ": " + told(options) + ", seed " + std::to_string(seed));
                ShuffledLauncher shuffled(seed);
                expect_same_tree(launched_build(shuffled, MeshView(scene.mesh()), options),
                                 MeshView(scene.mesh()), options);
            }
    }
}

TEST(DeviceBuild, AHundredOrdersGiveOneTree) {
    const std::uint64_t orders = fewer(100, 20);
    const Mesh mesh = laced(random_soup(100 + 25 * thorough, 77), 11);
    for (const Builder builder : builders)
        for (const Fit fit : {Fit::atomic, Fit::levels, Fit::as_published}) {
            const BuildOptions options{.builder = builder, .fit = fit};
            const std::string expected = tree_hash(build_bvh(mesh, {.builder = builder}));
            for (std::uint64_t seed = 0; seed < orders; ++seed) {
                ShuffledLauncher shuffled(seed);
                const LaunchedBuild built = launched_build(shuffled, MeshView(mesh), options);
                ASSERT_EQ(tree_hash(built.bvh), expected) << told(options) << ", seed " << seed;
            }
        }
}

TEST(DeviceBuild, ClustersAreNumberedAsOnTheHost) {
    // Nodes and order, not only the tree: preorder, whatever the threads did.
    std::uint64_t seed = 400;
    for (const std::size_t n : {1u, 2u, 3u, 17u, 33u, 300u, 2000u})
        for (const int max_leaf : {1, 4, 40, 255}) {
            const Mesh mesh = n % 2 == 0 ? lattice_mesh(n, 3, 9) : laced(random_soup(n, n), 19);
            const BuildOptions options{.builder = Builder::hploc, .max_leaf = max_leaf};
            const Bvh expected = build_bvh(mesh, options);
            ShuffledLauncher shuffled(++seed);
            const LaunchedBuild built = launched_build(shuffled, MeshView(mesh), options);
            SCOPED_TRACE(std::to_string(n) + " triangles, leaves of " + std::to_string(max_leaf) +
                         ", seed " + std::to_string(seed));
            EXPECT_TRUE(std::ranges::equal(std::as_bytes(built.bvh.nodes()),
                                           std::as_bytes(expected.nodes())));
            EXPECT_TRUE(std::ranges::equal(built.bvh.order(), expected.order()));
        }
}

TEST(DeviceBuild, IndicesPastTheVerticesAreLeftOutAndReported) {
    Mesh mesh = random_soup(50, 4);
    mesh.triangles[17][2] = 150;
    mesh.triangles[31][0] = 0xFFFFFFFFu;
    mesh.vertices[3 * 40].x = infinity;
    HostLauncher<> host;
    const LaunchedBuild built = launched_build(host, MeshView(mesh), {});
    EXPECT_EQ(built.counts.unreadable, 2u);
    EXPECT_EQ(built.counts.first_unreadable, 17u);
    EXPECT_EQ(built.counts.left_out, 1u);
    EXPECT_EQ(built.counts.first_left_out, 40u);
    EXPECT_EQ(built.counts.references, 47u);
    EXPECT_EQ(check(built.bvh).broken, "");
    EXPECT_THROW(check_counts(built.counts, PrimitiveKind::triangles, false), InputError);
    DeviceCounts readable = built.counts;
    readable.unreadable = 0;
    EXPECT_NO_THROW(check_counts(readable, PrimitiveKind::triangles, false));
    EXPECT_THROW(check_counts(readable, PrimitiveKind::triangles, true), InputError);
}

TEST(DeviceBuild, ScratchForManyServesFewer) {
    for_all_options([&](const BuildOptions& options) {
        std::size_t before = 0;
        for (std::uint32_t n = 0; n < 5000; n += 1 + n / 100) {
            with_device_build(DeviceBoxList{nullptr, n}, options, {}, [&](const auto& build) {
                Arena sizing = sizing_arena();
                IdleLauncher idle;
                build.run(idle, sizing);
                ASSERT_GE(sizing.bytes(), before) << n << ", " << told(options);
                before = sizing.bytes();
            });
        }
    });
}

TEST(DeviceBuild, OptionsOutOfRangeAreNamed) {
    const Mesh mesh = random_soup(3, 1);
    HostLauncher<> host;
    for (const BuildOptions& options :
         {BuildOptions{.bits = 31}, BuildOptions{.max_leaf = 0}, BuildOptions{.max_leaf = 256},
          BuildOptions{.builder = Builder::ploc}})
        EXPECT_THROW(check_device_options(options, 3), InputError) << told(options);
    EXPECT_THROW(check_device_options({}, std::uint64_t{1} << 31), InputError);
}

TEST(Device, NumbersThatNoneCanHaveAreNoSelectors) {
    const std::string before = selected_device();
    for (const char* selector : {"opencl:4294967296", "opencl:99999999999999999999",
                                 "hip:4294967296", "opencl:-1", "opencl:", "hip:0x"})
        EXPECT_THROW(select_device(selector), InputError) << selector;
    EXPECT_EQ(selected_device(), before);
}

TEST(Device, WithoutOneEveryCallSaysSo) {
    if (device_available()) GTEST_SKIP() << "there is a device: " << device_name();
    EXPECT_THROW(static_cast<void>(device_name()), BackendUnavailable);
    EXPECT_THROW(static_cast<void>(device_scratch_bytes(10, {})), BackendUnavailable);
    EXPECT_THROW(DeviceBvh(PrimitiveKind::triangles, 10, {}), BackendUnavailable);
    EXPECT_THROW(DeviceBuffer<float>(3), BackendUnavailable);
    EXPECT_NO_THROW(DeviceBuffer<float>());
}

}  // namespace
}  // namespace raydix::test
