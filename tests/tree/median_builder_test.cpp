// A builder outside of the library, which halves every range at its median, from triangles to a Bvh
// whose hits are those of brute force. How a builder comes into the library: docs/add-a-builder.md.
#include <gtest/gtest.h>
#include <raydix/check.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include "exec/parallel.h"
#include "layout/leaf_order.h"
#include "support/ray_sets.h"
#include "support/scenes.h"
#include "support/support.h"
#include "tree/bvh_internals.h"
#include "tree/place_clusters.h"

namespace raydix::test {
namespace {

/// Object median: the widest axis of the box around the centers, the lower half of them to the left
/// child. Equal centers go by id, so that the ids alone decide.
class MedianSplit {
public:
    /// boxes [n] and ids [n] of the primitives, in any order -> nodes [n - 1]
    MedianSplit(const BoxLanes& boxes, std::span<const std::uint32_t> ids, std::uint32_t max_leaf,
                Buffer<ClusterNode>& nodes)
        : boxes_(boxes), ids_(ids), max_leaf_(max_leaf), nodes_(nodes), places_(ids.size()) {
        std::iota(places_.begin(), places_.end(), 0u);
        nodes.reset(ids.size() - 1);
    }

    /// The root, which is a primitive if n = 1.
    ClusterRef run() { return build(0, places_.size()).ref; }

private:
    /// A node whose left half ends at m is node m - 1: each has a place of its own.
    ClusterPart build(std::size_t begin, std::size_t end) {
        if (end - begin == 1) {
            const std::uint32_t place = places_[begin];
            const Aabb box = boxes_.get(place);
            return {primitive_cluster | place, box, sum_of_primitive(ids_[place], box)};
        }
        const std::size_t middle = begin + (end - begin) / 2;
        halve(begin, middle, end);
        const ClusterPart left = build(begin, middle), right = build(middle, end);
        const ClusterNode& node = nodes_[middle - 1] = merge_clusters(left, right, max_leaf_);
        return {static_cast<ClusterRef>(middle - 1), {node.lo, node.hi}, node.sum};
    }

    void halve(std::size_t begin, std::size_t middle, std::size_t end) {
        const auto at = [&](std::size_t k) { return places_.begin() + std::ptrdiff_t(k); };
        Aabb centers = empty_box();
        for (std::size_t k = begin; k < end; ++k) {
            const Vec3 center = center_of(boxes_.get(places_[k]));
            centers = unite(centers, {center, center});
        }
        const Vec3 size = centers.hi - centers.lo;
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        std::nth_element(at(begin), at(middle), at(end), [&](std::uint32_t a, std::uint32_t b) {
            const Vec3 p = center_of(boxes_.get(a)), q = center_of(boxes_.get(b));
            const float x = (&p.x)[axis], y = (&q.x)[axis];
            return x != y ? x < y : ids_[a] < ids_[b];
        });
    }

    const BoxLanes& boxes_;
    std::span<const std::uint32_t> ids_;
    std::uint32_t max_leaf_;
    Buffer<ClusterNode>& nodes_;
    std::vector<std::uint32_t> places_;  // of boxes and ids, halved in place
};

enum class Ids { ascending, descending };

/// What build_bvh does around a builder: leaves out what does not count, places the clusters, and
/// copies triangles into the order of leaves. `given`: how the builder gets the primitives.
Bvh build_median(const MeshView& mesh, int max_leaf, Ids given = Ids::ascending) {
    const TriangleSource source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    const auto n = static_cast<std::uint32_t>(mesh.triangles.size());
    std::vector<std::uint32_t> ids;
    BoxLanes boxes;
    boxes.reset(n);
    for (std::uint32_t k = 0; k < n; ++k) {
        const std::uint32_t id = given == Ids::ascending ? k : n - 1 - k;
        Aabb box;
        if (!source.box(id, box)) continue;
        boxes.set(static_cast<std::uint32_t>(ids.size()), box);
        ids.push_back(id);
    }
    Bvh bvh;
    const BvhInternals tree{bvh};
    tree.kind() = PrimitiveKind::triangles;
    // It has no name of its own. This one promises nothing that a median split does not keep.
    tree.options() = {.builder = Builder::binned, .max_leaf = max_leaf};
    tree.input_count() = n;
    tree.left_out() = n - ids.size();
    if (ids.empty()) return bvh;
    Buffer<ClusterNode> nodes;
    const ClusterRef root =
        MedianSplit(boxes, ids, static_cast<std::uint32_t>(max_leaf), nodes).run();
    tree.inner_count() = place_clusters({nodes.data(), root, boxes, ids}, tree.nodes(),
                                        tree.order(), tree.max_depth());
    copy_to_leaf_order(source, tree.order().view(), tree.triangles());
    return bvh;
}

struct MeshInput {
    std::string name;
    Mesh mesh;
};

std::vector<MeshInput> median_inputs(std::uint64_t seed) {
    std::vector<MeshInput> inputs;
    for (const std::size_t n : {0, 1, 2, 3, 17, 1000})
        inputs.push_back({std::to_string(n) + " triangles", random_soup(n, seed + n, 0.2f)});
    const Mesh one = random_soup(1, seed, 0.5f);
    Mesh equal{"", one.vertices, std::vector<Triangle>(300, one.triangles[0])};
    inputs.push_back({"equal triangles", std::move(equal)});
    Mesh line = random_soup(300, seed, 0.02f);
    for (std::size_t v = 0; v < line.vertices.size(); ++v)
        line.vertices[v].x += 0.1f * static_cast<float>(v / 3);
    inputs.push_back({"all on a line", std::move(line)});
    Mesh holes = random_soup(1000, seed, 0.2f);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    for (std::size_t v = 0; v < holes.vertices.size(); v += 17) holes.vertices[v].y = nan;
    inputs.push_back({"vertices that are NaN", std::move(holes)});
    Mesh nothing = random_soup(20, seed);
    for (Vec3& vertex : nothing.vertices) vertex.x = nan;
    inputs.push_back({"NaN alone", std::move(nothing)});
    inputs.push_back({"lattice", lattice_mesh(1000, 5, seed)});
    inputs.push_back({"huge", scaled(random_soup(300, seed, 0.2f), 5e11f)});
    inputs.push_back({"tiny", scaled(random_soup(300, seed, 0.2f), 1e-9f)});
    return inputs;
}

/// Those of the mesh itself, and those of another one that has triangles in any case.
std::vector<Ray> rays_at(const Mesh& mesh, std::uint64_t seed) {
    const std::size_t count = 50 * thorough;
    std::vector<Ray> rays =
        make_mixed_rays(scene_of(random_soup(100, seed, 0.2f), "soup"), count, seed);
    if (mesh.triangles.empty()) return rays;
    const std::vector<Ray> own = make_mixed_rays(scene_of(mesh, "mesh"), count, seed + 1);
    rays.insert(rays.end(), own.begin(), own.end());
    return rays;
}

void expect_same_bits(std::span<const Hit> hits, std::span<const Hit> expected) {
    ASSERT_EQ(hits.size(), expected.size());
    for (std::size_t i = 0; i < hits.size(); ++i)
        ASSERT_EQ(std::memcmp(&hits[i], &expected[i], sizeof(Hit)), 0) << "ray " << i;
}

TEST(MedianBuilder, TreesAreValidAndHitsAreThoseOfBruteForce) {
    constexpr std::uint64_t seed = 1127;
    for (const auto& [name, mesh] : median_inputs(seed)) {
        const std::vector<Ray> rays = rays_at(mesh, seed);
        const std::vector<Hit> expected = trace_brute_force(mesh, rays);
        for (const int max_leaf : {1, 4, 255}) {
            SCOPED_TRACE(name + ", max_leaf " + std::to_string(max_leaf) + ", seed " +
                         std::to_string(seed));
            const Bvh tree = build_median(mesh, max_leaf);
            const CheckReport valid = check(tree, mesh);
            ASSERT_TRUE(valid.ok) << valid.broken;
            expect_same_bits(trace(tree, rays), expected);
            expect_same_bits(trace(WideBvh(tree), rays), expected);
        }
    }
}

TEST(MedianBuilder, LeavesOutWhatABuildLeavesOut) {
    for (const auto& [name, mesh] : median_inputs(5)) {
        if (mesh.triangles.empty()) continue;
        EXPECT_EQ(build_median(mesh, 4).left_out(), build_bvh(mesh).left_out()) << name;
    }
}

/// Halves differ by one primitive at most, also where all centers are equal.
TEST(MedianBuilder, DepthIsTheLeast) {
    for (const auto& [name, mesh] : median_inputs(9)) {
        const Bvh tree = build_median(mesh, 1);
        if (tree.empty()) continue;
        const auto least = static_cast<std::uint32_t>(std::bit_width(tree.order().size() - 1));
        EXPECT_EQ(tree.max_depth(), least) << name;
    }
}

TEST(MedianBuilder, TreeDependsOnNothingButTheMesh) {
    std::vector<MeshInput> inputs = median_inputs(3);
    inputs.push_back({"more than one task", random_soup(20'000, 3)});
    for (const MeshInput& input : inputs) {
        const auto hash_of = [&](int threads, Ids given) {
            std::string hash;
            with_threads(threads, [&] { hash = tree_hash(build_median(input.mesh, 4, given)); });
            return hash;
        };
        const std::string one = hash_of(1, Ids::ascending);
        EXPECT_EQ(hash_of(7, Ids::ascending), one) << input.name;
        EXPECT_EQ(hash_of(2, Ids::descending), one) << input.name;
    }
}

}  // namespace
}  // namespace raydix::test
