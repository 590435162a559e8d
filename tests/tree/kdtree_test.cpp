// build_kdtree against the recursive reference: every kind of input, both code lengths, leaf sizes,
// threads; the same launches in any order; equal points.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/kdtree.h>
#include <raydix/model.h>

#include <algorithm>
#include <cstring>
#include <numeric>

#include "exec/host_launcher.h"
#include "layout/leaf_order.h"
#include "support/kd_reference.h"
#include "support/point_sets.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"
#include "tree/kdtree.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t kdtree_seed = 77;

bool same_nodes(std::span<const KdNode> a, std::span<const KdNode> b) {
    return a.size() == b.size() &&
           (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

void compare_all(const std::string& name, const MeshView& mesh) {
    for (const int bits : {30, 63}) {
        for (const int max_leaf : {1, 2, 8, 64, 255}) {
            if (sanitized && (max_leaf == 2 || max_leaf == 64)) continue;
            KdTreeOptions options{.bits = bits, .max_leaf = max_leaf};
            const KdTree expected = reference_kdtree(mesh, options);
            const std::string hash = kd_hash(expected);
            KdTree first;
            for (const int threads : {1, 2, 7}) {
                if (sanitized && threads == 2) continue;
                options.threads = threads;
                SCOPED_TRACE(name + ", bits " + std::to_string(bits) + ", max_leaf " +
                             std::to_string(max_leaf) + ", threads " + std::to_string(threads) +
                             ", seed " + std::to_string(kdtree_seed));
                KdTree built = build_kdtree(mesh, options);
                EXPECT_EQ(kd_check(built, mesh).broken, "");
                ASSERT_EQ(kd_hash(built), hash);
                EXPECT_EQ(built.max_depth(), expected.max_depth());
                EXPECT_EQ(built.left_out(), expected.left_out());
                if (threads == 1)
                    first = std::move(built);
                else
                    EXPECT_TRUE(same_nodes(built.nodes(), first.nodes()));
            }
        }
    }
}

TEST(KdTree, PointsLikeTheReference) {
    for (const PointSet& set : point_sets(120 * thorough, kdtree_seed))
        compare_all(set.name, MeshView(set.points, {}));
}

TEST(KdTree, TrianglesLikeTheReference) {
    compare_all("soup", random_soup(100 * thorough, 3));
    compare_all("large triangles", random_soup(40 * thorough, 4, 1.0f));
    compare_all("lattice", lattice_mesh(100 * thorough, 6, 5));
    compare_all("far off", moved(random_soup(50 * thorough, 4), {1e5f, -2e5f, 5e6f}));
    Mesh bad = random_soup(500, 6);
    bad.triangles[9] = {0, 0, 0};
    bad.vertices[300].y = std::numeric_limits<float>::quiet_NaN();
    bad.vertices[600] = {-0.0f, 0.25f, -0.0f};
    compare_all("soup with invalid ones", bad);
    for (const Model& scene : builtin_triangle_scenes(fewer(500 * thorough, 3)))
        compare_all(scene.name, scene.mesh());
}

TEST(KdTree, SharedBunnyLikeTheReference) {
    const auto file = shared_scene("bunny/bunny.ply.xz");
    RAYDIX_SKIP_WITHOUT(file);
    const Mesh mesh = load_mesh(file);
    for (const int bits : {30, 63}) {
        const KdTreeOptions options{.bits = bits, .max_leaf = 4};
        const KdTree built = build_kdtree(mesh, options);
        EXPECT_EQ(kd_hash(built), kd_hash(reference_kdtree(mesh, options)));
        EXPECT_EQ(kd_check(built, mesh).broken, "");
        EXPECT_GT(built.leaf_count(), 1000u);
    }
}

TEST(KdTree, EqualPointsAreSplitByPosition) {
    const std::vector<Vec3> points(50'000 * thorough, Vec3{4, 5, 6});
    const KdTree tree = build_kdtree(points, {.max_leaf = 8});
    EXPECT_EQ(kd_check(tree, MeshView(points, {})).broken, "");
    const auto levels = static_cast<std::uint32_t>(std::bit_width(points.size() - 1));
    EXPECT_LE(tree.max_depth(), levels);
    EXPECT_GE(tree.max_depth(), levels - 4);
    for (const KdNode& node : tree.nodes().subspan(2)) {
        ASSERT_TRUE(node.is_leaf() || node.splits_equal_codes());
        ASSERT_EQ(node.lo, node.hi);
    }
}

TEST(KdTree, SplitsOfAHandMadeTree) {
    // On a grid of 1024 cells a unit: x < 512 and >= 512; the right pair differs first in y.
    const std::vector<Vec3> points{{0, 0, 0}, {1024, 0, 0}, {512, 600, 0}};
    const KdTree tree = build_kdtree(points, {.bits = 30, .max_leaf = 1});
    ASSERT_EQ(tree.nodes().size(), 6u);
    const KdNode& root = tree.nodes()[0];
    EXPECT_EQ(root.axis(), 0u);
    EXPECT_EQ(root.plane, 512.0f);
    const KdNode& left = tree.nodes()[root.child()];
    EXPECT_TRUE(left.is_leaf());
    EXPECT_EQ(left.count(), 1u);
    EXPECT_EQ(left.lo, 0.0f);
    EXPECT_EQ(left.hi, 0.0f);
    const KdNode& right = tree.nodes()[root.child() + 1];
    EXPECT_EQ(right.axis(), 1u);
    EXPECT_EQ(right.plane, 512.0f);
    EXPECT_EQ(right.lo, 512.0f);
    EXPECT_EQ(right.hi, 1024.0f);
    EXPECT_EQ(tree.max_depth(), 2u);
    EXPECT_TRUE(std::ranges::equal(tree.order(), std::vector<std::uint32_t>{0, 1, 2}));
}

TEST(KdTree, StatisticsCountTheTree) {
    const Mesh mesh = random_soup(3000, 8);
    const KdTree tree = build_kdtree(mesh);
    const TreeStats stats = kd_stats(tree);
    std::uint64_t leaves = 0, references = 0;
    for (std::size_t slot = 0; slot < tree.nodes().size(); ++slot) {
        if (slot == 1 || !tree.nodes()[slot].is_leaf()) continue;
        ++leaves;
        references += tree.nodes()[slot].count();
    }
    EXPECT_EQ(stats.leaves, leaves);
    EXPECT_EQ(stats.nodes, 2 * leaves - 1);
    EXPECT_EQ(stats.references, references);
    EXPECT_EQ(references, mesh.triangles.size());
    EXPECT_EQ(stats.max_depth, tree.max_depth());
    EXPECT_EQ(stats.depth_bound, 63u + 12u);
    EXPECT_FALSE(stats.sah.has_value());
    EXPECT_EQ(stats.bytes, 2 * leaves * 16 + 3000 * (4 + 36));
    EXPECT_EQ(stats.tree_hash, kd_hash(tree));
    EXPECT_GE(tree.peak_bytes(), stats.bytes);
    const TreeStats none = kd_stats(build_kdtree(Mesh{}));
    EXPECT_EQ(none.nodes, 0u);
    EXPECT_FALSE(none.depth_bound.has_value());
}

TEST(KdTree, LeafSizeUnlessGivenGoesByTheKind) {
    const Mesh mesh = random_soup(500, 1);
    EXPECT_EQ(build_kdtree(mesh).options().max_leaf, 4);
    EXPECT_EQ(kd_hash(build_kdtree(mesh)), kd_hash(build_kdtree(mesh, {.max_leaf = 4})));
    EXPECT_EQ(build_kdtree(mesh.vertices).options().max_leaf, 8);
}

TEST(KdTree, RefusesWhatItCannotBuild) {
    const Mesh mesh = random_soup(10, 1);
    EXPECT_THROW((void)build_kdtree(mesh, {.bits = 31}), InputError);
    EXPECT_THROW((void)build_kdtree(mesh, {.max_leaf = -1}), InputError);
    EXPECT_THROW((void)build_kdtree(mesh, {.max_leaf = 256}), InputError);
    Mesh broken = mesh;
    broken.triangles[3][1] = 30;
    try {
        (void)build_kdtree(broken);
        ADD_FAILURE();
    } catch (const InputError& error) {
        EXPECT_STREQ(error.what(), "triangle 3: index 30 is past the last of 30 vertices");
    }
    const std::vector<Vec3> points{{0, 0, 0}, {infinity, 0, 0}};
    EXPECT_EQ(build_kdtree(points).left_out(), 1u);
    EXPECT_THROW((void)build_kdtree(points, {.strict = true}), InputError);
}

/// Runs the items of each launch last to first, and writes down what they are called.
struct BackwardLauncher {
    using Probe = NoProbe;
    std::vector<std::string> labels;

    template <class Work>
    void launch(const char* label, std::uint32_t n, const Work& work) {
        labels.emplace_back(label);
        for (std::uint32_t i = n; i-- > 0;) work(i);
    }
    template <class Work>
    void launch_counted(const char* label, const std::uint32_t* count, std::uint32_t limit,
                        const Work& work) {
        launch(label, std::min(*count, limit), work);
    }
    void exclusive_scan(const char* label, std::uint32_t* values, std::uint32_t n,
                        std::uint32_t* total) {
        labels.emplace_back(label);
        const std::uint32_t sum = std::reduce(values, values + n);
        std::exclusive_scan(values, values + n, values, 0u);
        *total = sum;
    }
};

/// Sorted codes and points for launchers that are called by hand.
struct Prepared {
    KdTree tree;
    std::vector<std::uint64_t> codes;
    Grid grid{};
    std::uint32_t count = 0;
    KdKeys<std::uint64_t> keys{};

    explicit Prepared(const std::vector<Vec3>& points, int max_leaf)
        : tree(build_kdtree(points, {.max_leaf = max_leaf})) {
        grid = make_grid(tree.bounds(), 21);
        for (const Vec3& p : tree.points())
            codes.push_back(interleave<std::uint64_t>(grid.cell(p)));
        count = static_cast<std::uint32_t>(codes.size());
        keys = {codes.data(), count, &count, &grid, static_cast<std::uint32_t>(max_leaf)};
    }
    Prepared(const Prepared&) = delete;
    Prepared& operator=(const Prepared&) = delete;
};

template <class Launcher>
std::vector<KdNode> nodes_by(Launcher& launcher, const Prepared& in, std::uint32_t inner,
                             std::uint32_t* depth) {
    const auto n = in.keys.limit;
    std::vector<RadixRange> ranges(n - 1);
    std::vector<std::uint32_t> rank(n - 1), parent(inner);
    std::vector<std::uint8_t> meeting(inner);
    std::vector<Aabb> boxes(2 * inner + 2);
    std::vector<KdNode> nodes(2 * inner + 2);
    std::uint32_t count = 0;
    const KdRanges found{ranges.data(), rank.data(), &count};
    find_kd_ranges(launcher, in.keys, found);
    EXPECT_EQ(count, inner);
    emit_kd_nodes(launcher, in.keys, found, {parent.data(), meeting.data(), boxes.data()},
                  LeafBoxOf<Vec3>{in.tree.points().data()}, nodes.data(), depth);
    return nodes;
}

TEST(KdTreePipeline, OrderOfWorkDoesNotMatterAndCountsAreTaken) {
    const auto sets = point_sets(60 * thorough, kdtree_seed);
    for (const PointSet& set : sets) {
        const Prepared in(set.points, 2);
        if (in.codes.size() <= 2) continue;
        SCOPED_TRACE(set.name);
        std::uint32_t depth = 0;
        BackwardLauncher backward;
        const auto nodes = nodes_by(backward, in, in.tree.inner_count(), &depth);
        EXPECT_TRUE(same_nodes(nodes, in.tree.nodes()));
        EXPECT_EQ(depth, in.tree.max_depth());
        EXPECT_EQ(backward.labels,
                  (std::vector<std::string>{"kdtree.ranges", "kdtree.ranks", "kdtree.leaf",
                                            "kdtree.emit", "kdtree.fit"}));
        std::vector<LaunchRecord> log;
        HostLauncher<CountProbe> counting(&log);
        const auto again = nodes_by(counting, in, in.tree.inner_count(), &depth);
        EXPECT_TRUE(same_nodes(again, in.tree.nodes()));
        ASSERT_EQ(log.size(), 5u);
        EXPECT_EQ(log[0].items, in.codes.size() - 1);
        EXPECT_EQ(log[4].items, in.tree.inner_count());
        for (const LaunchRecord& record : log) EXPECT_GT(record.bytes, record.items);
    }
}

}  // namespace
}  // namespace raydix::test
