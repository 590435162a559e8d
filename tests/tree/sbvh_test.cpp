// Spatial splits against clipping in double, and the builder's independence of lanes and threads.
#include <gtest/gtest.h>
#include <raydix/check.h>
#include <raydix/model.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"
#include "tree/clip.h"
#include "tree/sbvh_build.h"
#include "tree/spatial_split.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t sbvh_seed = 20090804;

std::vector<SplitBox> references_of(const Mesh& mesh) {
    std::vector<SplitBox> all;
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        const Triangle& t = mesh.triangles[i];
        const Aabb box = box_of(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]);
        all.push_back(SplitBox::of(box, i, 1));
    }
    return all;
}

Aabb box_of_all(const std::vector<SplitBox>& references) {
    Aabb box = empty_box();
    for (const SplitBox& r : references) box = unite(box, r.box());
    return box;
}

/// What a plane costs if each triangle is clipped to its reference's box and to both sides.
double cost_by_clipping(const Mesh& mesh, const std::vector<SplitBox>& references, std::size_t axis,
                        float plane) {
    double cost = 0;
    for (const double sign : {1.0, -1.0}) {
        Polygon::Point lo{infinity, infinity, infinity}, hi{-infinity, -infinity, -infinity};
        int count = 0;
        for (const SplitBox& r : references) {
            const Triangle& t = mesh.triangles[r.first];
            Polygon part = clip(
                polygon_of(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]), r.box());
            part = clip(part, axis, plane, sign);
            count += part.count != 0 ? 1 : 0;
            for (std::size_t i = 0; i < part.count; ++i)
                for (std::size_t k = 0; k < 3; ++k) {
                    lo[k] = std::min(lo[k], part.corners[i][k]);
                    hi[k] = std::max(hi[k], part.corners[i][k]);
                }
        }
        if (count == 0) return infinity;
        const double x = hi[0] - lo[0], y = hi[1] - lo[1], z = hi[2] - lo[2];
        cost += (x * y + y * z + z * x) * count;
    }
    return cost;
}

TEST(SpatialSplit, IsTheCheapestPlaneByClipping) {
    for (const std::size_t n : {2, 3, 20, 200}) {
        const Mesh mesh = random_soup(n, sbvh_seed + n, 0.5f);
        const ReferenceCutter cutter((MeshView(mesh)));
        std::vector<SplitBox> references = references_of(mesh);
        // References that are parts already.
        for (SplitBox& r : references)
            if (r.first % 3 == 1) {
                const Aabb box = r.box();
                const CutReference parts = cutter.cut(r, 1, 0.5f * (box.lo.y + box.hi.y));
                ASSERT_FALSE(is_empty(parts.left));
                r = SplitBox::of(parts.left, r.first, 1);
            }
        const Aabb box = box_of_all(references);
        for (const std::uint32_t bins : {8u, 16u, 128u}) {
            SCOPED_TRACE(std::to_string(n) + " triangles, " + std::to_string(bins) +
                         " bins, seed " + std::to_string(sbvh_seed + n));
            const SpatialSplit found = find_spatial_split(cutter, references, box, bins);
            ASSERT_LT(found.cost, infinity);
            EXPECT_NEAR(cost_by_clipping(mesh, references, found.axis, found.plane) / found.cost,
                        1.0, 1e-3);
            for (std::size_t axis = 0; axis < 3; ++axis)
                for (std::uint32_t b = 1; b < bins; ++b) {
                    const float lo = (&box.lo.x)[axis], hi = (&box.hi.x)[axis];
                    const float plane =
                        lo + (hi - lo) * static_cast<float>(b) / static_cast<float>(bins);
                    EXPECT_GE(cost_by_clipping(mesh, references, axis, plane),
                              double(found.cost) * (1 - 1e-3));
                }
        }
    }
}

/// Small ones among few large ones: some stand for all, and are not sliced.
TEST(SpatialSplit, OfManyTrianglesIsNearlyTheCheapest) {
    Mesh mesh = random_soup(40000, sbvh_seed, 0.02f);
    for (Vec3& v : mesh.vertices) v.x *= v.x;  // denser at one end
    const std::size_t large = 12;
    const Mesh sheets = random_soup(large, sbvh_seed + 1, 1.5f);
    for (const Triangle& t : sheets.triangles) {
        const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
        for (const std::uint32_t v : t) mesh.vertices.push_back(sheets.vertices[v]);
        mesh.triangles.push_back({first, first + 1, first + 2});
    }
    const ReferenceCutter cutter((MeshView(mesh)));
    const std::vector<SplitBox> references = references_of(mesh);
    const Aabb box = box_of_all(references);
    constexpr std::uint32_t bins = 128;
    const SpatialSplit found = find_spatial_split(cutter, references, box, bins);
    const double cost = cost_by_clipping(mesh, references, found.axis, found.plane);
    EXPECT_NEAR(cost / found.cost, 1.0, 0.02);
    for (std::size_t axis = 0; axis < 3; ++axis)
        for (std::uint32_t b = 8; b < bins; b += sanitized ? 24 : 8) {
            const float lo = (&box.lo.x)[axis], hi = (&box.hi.x)[axis];
            const float plane = lo + (hi - lo) * static_cast<float>(b) / static_cast<float>(bins);
            EXPECT_GE(cost_by_clipping(mesh, references, axis, plane), 0.98 * cost);
        }
}

TEST(SpatialSplit, DoesNotDependOnTheOrderNorOnBlocks) {
    const Mesh mesh = random_soup(2 * parallel_boxes + 5, sbvh_seed, 0.02f);
    const ReferenceCutter cutter((MeshView(mesh)));
    std::vector<SplitBox> references = references_of(mesh);
    const Aabb box = box_of_all(references);
    const SpatialSplit found = find_spatial_split(cutter, references, box, 32);
    std::mt19937_64 random(sbvh_seed);
    std::shuffle(references.begin(), references.end(), random);
    const SpatialSplit other = find_spatial_split(cutter, references, box, 32);
    EXPECT_EQ(found.cost, other.cost);
    EXPECT_EQ(found.plane, other.plane);
    EXPECT_EQ(found.left, other.left);
    EXPECT_EQ(found.right, other.right);
    // Each triangle is on some side; of small ones some stand for all.
    const auto n = static_cast<double>(references.size());
    EXPECT_NEAR(found.left + found.right, n, 0.05 * n);
}

struct PlainTree {
    std::vector<BvhNode> nodes;
    std::vector<std::uint32_t> order;
};

PlainTree build(const Mesh& mesh, int width, const SpatialOptions& options) {
    const ReferenceCutter cutter((MeshView(mesh)));
    const std::vector<SplitBox> references = references_of(mesh);
    const auto n = static_cast<std::uint32_t>(references.size());
    SbvhScratch scratch;
    scratch.references.reset(std::size_t{n} + spatial_spare(n, options));
    std::copy(references.begin(), references.end(), scratch.references.data());
    Buffer<BvhNode> nodes;
    Buffer<std::uint32_t> order;
    std::uint32_t max_depth = 0;
    build_sbvh({cutter, n, 4, options}, scratch, nodes, order, max_depth, width);
    return {{nodes.data(), nodes.data() + nodes.size()},
            {order.data(), order.data() + order.size()}};
}

TEST(SbvhWidths, GiveTheSameTree) {
    SpatialOptions eager;
    eager.least_overlap = 0;
    eager.least_own_overlap = 0;
    for (const SpatialOptions& options : {SpatialOptions{}, eager}) {
        const Mesh mesh = random_soup(3000, sbvh_seed, 0.3f);
        const PlainTree expected = build(mesh, 4, options);
        EXPECT_GT(expected.order.size(), mesh.triangles.size());
        for (const int width : {8, 16}) {
            if (width > split_width()) continue;
            const PlainTree tree = build(mesh, width, options);
            EXPECT_EQ(tree.order, expected.order);
            ASSERT_EQ(tree.nodes.size(), expected.nodes.size());
            EXPECT_EQ(std::memcmp(tree.nodes.data(), expected.nodes.data(),
                                  tree.nodes.size() * sizeof(BvhNode)),
                      0)
                << width << " lanes";
        }
    }
}

TEST(SbvhBudget, IsKept) {
    const Mesh mesh = random_soup(3000, sbvh_seed, 0.5f);
    for (const double budget : {0.0, 0.1, 1.0}) {
        SpatialOptions options;
        options.budget = budget;
        options.least_overlap = 0;
        options.least_own_overlap = 0;
        const std::size_t references = build(mesh, split_width(), options).order.size();
        EXPECT_LE(references, mesh.triangles.size() + spatial_spare(3000, options));
        EXPECT_EQ(references > mesh.triangles.size(), budget > 0);
    }
}

TEST(Sbvh, TakesALeafThatCostsAsMuchAsItsSubtree) {
    Mesh mesh;  // on a line: nothing has a surface, so nothing costs anything
    for (std::uint32_t i = 0; i < 4; ++i) {
        const auto x = static_cast<float>(i);
        for (const float step : {0.0f, 0.5f, 0.7f}) mesh.vertices.push_back({x + step, 0, 0});
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    const PlainTree tree = build(mesh, split_width(), {});
    EXPECT_EQ(tree.order, (std::vector<std::uint32_t>{0, 1, 2, 3}));
    EXPECT_EQ(tree.nodes[0].count, 4u);
}

TEST(Sbvh, LargeNodesGiveTheSameTreeOnEachNumberOfThreads) {
    const Mesh mesh = random_soup(2 * parallel_boxes + 999, sbvh_seed, 0.02f);
    BuildOptions options;
    options.builder = Builder::sbvh;
    options.threads = 1;
    const Bvh one = build_bvh(mesh, options);
    EXPECT_TRUE(check(one).ok);
    options.threads = 3;
    const CheckReport same = check_same(one, build_bvh(mesh, options));
    EXPECT_TRUE(same.ok) << same.broken;
}

}  // namespace
}  // namespace raydix::test
