// Wide trees as they lie in memory: every node and triangle once, every box around what is below
// it.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/raydix.h>
#include <raydix/wide.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include "layout/wide_bvh.h"
#include "primitives/zero_area.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

class Walk {
public:
    explicit Walk(const WideBvh& tree) : arrays_(tree.arrays()), nodes_(tree.stats().nodes) {}

    /// The box of all triangles below; checks each child's box on the way.
    Aabb below(std::uint32_t w, std::uint32_t depth = 0) {
        EXPECT_EQ(nodes_.at(w)++, 0);
        Aabb all = empty_box();
        for (int s = 0; s < 8; ++s) {
            const std::uint32_t word = arrays_.stats.compact ? arrays_.compact_nodes[w].child[s]
                                                             : arrays_.nodes[w].child[s];
            expect_marked(w, s, word != wide_no_child);
            if (word == wide_no_child) continue;
            deepest = std::max(deepest, depth + 1);
            const Aabb box = (word & wide_leaf_bit) != 0 ? leaf_box(word) : below(word, depth + 1);
            EXPECT_TRUE(contains(w, s, box)) << "node " << w << ", slot " << s;
            all = unite(all, box);
        }
        return all;
    }
    [[nodiscard]] bool every_node_once() const {
        return std::ranges::all_of(nodes_, [](int times) { return times == 1; });
    }

    std::map<std::uint32_t, int> seen;  // triangle -> references
    std::uint32_t deepest = 0;

private:
    void expect_marked(std::uint32_t w, int s, bool used) const {
        if (arrays_.stats.compact)
            EXPECT_EQ((arrays_.compact_nodes[w].used >> s & 1) != 0, used);
        else
            for (int axis = 0; axis < 3; ++axis) {
                EXPECT_EQ(arrays_.nodes[w].lo[axis][s] < infinity, used);
                EXPECT_EQ(arrays_.nodes[w].hi[axis][s] > -infinity, used);
            }
    }
    /// Exactly; but for what a difference of two floats lacks as a double.
    [[nodiscard]] bool contains(std::uint32_t w, int s, const Aabb& box) const {
        if (arrays_.stats.compact) return contains_exactly(arrays_.compact_nodes[w], s, box);
        bool inside = true;
        for (int axis = 0; axis < 3; ++axis) {
            const double middle = coordinate(arrays_.middle, axis);
            inside = inside && arrays_.nodes[w].lo[axis][s] <= coordinate(box.lo, axis) - middle &&
                     arrays_.nodes[w].hi[axis][s] >= coordinate(box.hi, axis) - middle;
        }
        return inside;
    }

    Aabb leaf_box(std::uint32_t word) {
        const std::uint32_t place = (word & ~wide_leaf_bit) >> 3, count = (word & 7) + 1;
        EXPECT_LE(place % block_lanes + count, block_lanes);
        EXPECT_LE(count, wide_max_leaf);
        TriangleBlock block{};
        for (std::uint32_t lane = place % block_lanes; lane < place % block_lanes + count; ++lane)
            if (arrays_.stats.compact)
                put_together(arrays_.compact_blocks[place / block_lanes], lane, block);
            else
                block = arrays_.blocks[place / block_lanes];
        Aabb box = empty_box();
        for (std::uint32_t lane = place % block_lanes; lane < place % block_lanes + count; ++lane) {
            ++seen[block.prim[lane]];
            EXPECT_TRUE(places_.emplace(place / block_lanes * block_lanes + lane, 0).second);
            for (int v = 0; v < 3; ++v) {
                const Vec3 p{block.corner[3 * v][lane], block.corner[3 * v + 1][lane],
                             block.corner[3 * v + 2][lane]};
                box = unite(box, {p, p});
            }
        }
        return box;
    }

    void put_together(const CompactBlock& from, std::uint32_t lane, TriangleBlock& block) const {
        const auto corner = [&](int v) { return arrays_.vertices[from.vertex[v][lane]]; };
        block.set(lane, {corner(0), corner(1), corner(2)}, from.prim[lane]);
    }

    const WideBvh::Arrays& arrays_;
    std::vector<int> nodes_;
    std::map<std::uint32_t, int> places_;
};

void expect_sound(const Mesh& mesh, const BuildOptions& options, const WideBvhOptions& layout) {
    const Bvh bvh = build_bvh(mesh, options);
    const WideBvh tree(bvh, layout);
    std::uint64_t with_area = 0;
    for (const LeafTriangle& t : bvh.triangles()) with_area += !has_zero_area(t);
    const WideBvhStats& stats = tree.stats();
    EXPECT_EQ(stats.references, with_area);
    if (stats.nodes == 0) return;
    Walk walk(tree);
    walk.below(0);
    EXPECT_TRUE(walk.every_node_once());
    EXPECT_LE(walk.deepest, stats.max_depth);
    std::map<std::uint32_t, int> wanted;
    for (std::size_t k = 0; k < bvh.order().size(); ++k)
        if (!has_zero_area(bvh.triangles()[k])) ++wanted[bvh.order()[k]];
    EXPECT_EQ(walk.seen, wanted);
    EXPECT_EQ(stats.bytes,
              stats.nodes * (layout.compact ? 96 : 224) + tree.arrays().blocks.size() * 160 +
                  tree.arrays().compact_blocks.size() * 64 + tree.arrays().vertices.size() * 12);
    EXPECT_TRUE(layout.compact ? tree.arrays().blocks.empty()
                               : tree.arrays().compact_blocks.empty());
    EXPECT_GE(stats.widening, 1.0 - 1e-12);
    EXPECT_LE(stats.children_per_node, layout.width);
}

void expect_sound(const Mesh& mesh, const BuildOptions& options) {
    for (const bool compact : {false, true})
        for (const int width : {4, 8})
            expect_sound(mesh, options, {.width = width, .compact = compact});
}

TEST(WideLayout, HoldsEveryTriangleInItsBoxes) {
    for (const std::size_t n : {1u, 2u, 3u, 4u, 5u, 8u, 9u, 33u, 1000u, 20'000u}) {
        expect_sound(random_soup(n, n), {});
        expect_sound(lattice_mesh(n, 7, n), {.builder = Builder::binned, .max_leaf = 1});
    }
    for (const float scale : {1e-9f, 1e12f}) expect_sound(scaled(random_soup(500, 3), scale), {});
    expect_sound(moved(random_soup(500, 3), {1e9f, -1e9f, 1e3f}), {});
}

TEST(WideLayout, LeavesOutWhatHasNoArea) {
    Mesh mesh = random_soup(300, 5);
    for (std::size_t k = 0; k < 300; k += 2) mesh.triangles[k][1] = mesh.triangles[k][0];
    expect_sound(mesh, {});
    for (Triangle& t : mesh.triangles) t[1] = t[0];
    expect_sound(mesh, {});
}

TEST(WideLayout, WastesLittleOnBlocks) {
    const WideBvh tree(build_bvh(random_soup(20'000, 1), {.max_leaf = 1}));
    const auto places = static_cast<double>(block_lanes * tree.arrays().blocks.size());
    EXPECT_LT(places, 1.1 * static_cast<double>(tree.stats().references));
}

bool same_bits(const WideBvh& a, const WideBvh& b) {
    const auto equal = [](const auto& x, const auto& y) {
        return std::ranges::equal(std::as_bytes(x.view()), std::as_bytes(y.view()));
    };
    return equal(a.arrays().nodes, b.arrays().nodes) &&
           equal(a.arrays().blocks, b.arrays().blocks) &&
           equal(a.arrays().compact_nodes, b.arrays().compact_nodes) &&
           equal(a.arrays().compact_blocks, b.arrays().compact_blocks) &&
           equal(a.arrays().vertices, b.arrays().vertices);
}

TEST(WideLayout, IsTheSameForEveryThreadCount) {
    for (const std::size_t n : {5000u, 60'000u}) {
        const Bvh bvh = build_bvh(random_soup(n, 2));
        const WideBvh one(bvh, {.threads = 1}), many(bvh, {.threads = 5});
        EXPECT_TRUE(same_bits(one, many));
    }
}

/// Many triangles in each of a few places, so that there are parts of all sizes.
Mesh crowded_mesh() {
    constexpr std::size_t part = thorough > 1 ? 10'000 : 4'000;  // enough for several threads
    Mesh mesh = random_soup(3 * part, 4);
    const auto add = [&](const Mesh& other) {
        const auto base = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.insert(mesh.vertices.end(), other.vertices.begin(), other.vertices.end());
        for (const Triangle& t : other.triangles)
            mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
    };
    add(scaled(random_soup(2 * part, 5), 1e-3f));
    add(moved(scaled(random_soup(40, 6), 0.1f), {3, 0, 0}));
    return mesh;
}

TEST(WideBuild, GivesTheTreeThatTheBinaryOneGives) {
    WideBvhBuilder builder;
    WideBvh tree;
    for (const Mesh& mesh : {crowded_mesh(), random_soup(700, 1), random_soup(1, 1), Mesh{},
                             lattice_mesh(fewer(1'000 * thorough, 2), 7, 3), random_soup(3, 9)})
        for (const Builder name : {Builder::ploc, Builder::hploc, Builder::binned, Builder::karras,
                                   Builder::apetrei, Builder::sbvh})
            for (const int max_leaf : {1, 4, 5}) {
                const bool few = thorough == 1 && mesh.triangles.size() > 400;
                if (few && max_leaf != 4) continue;
                const bool straight = name == Builder::apetrei && max_leaf == 4;
                const BuildOptions options{.builder = name, .max_leaf = max_leaf, .threads = 3};
                const Bvh binary = build_bvh(mesh, options);
                for (const WideBvhOptions layout :
                     {WideBvhOptions{.width = 4}, WideBvhOptions{.width = 8},
                      WideBvhOptions{.width = 8, .compact = true}}) {
                    if (few && layout.width == 4) continue;
                    if (straight && !layout.compact) continue;  // tests/layout/sorted_wide_test.cpp
                    builder.build(mesh, options, tree, layout);
                    const WideBvh other(binary, layout);
                    EXPECT_TRUE(same_bits(tree, other))
                        << builder_name(name) << ", " << mesh.triangles.size() << " triangles";
                    EXPECT_EQ(tree.stats().max_depth, other.stats().max_depth);
                    EXPECT_EQ(tree.stats().sah, other.stats().sah);
                    EXPECT_EQ(tree.stats().input_count, mesh.triangles.size());
                }
            }
}

TEST(WideBuild, CompactTreesShareVertices) {
    const Mesh mesh = load_model("builtin:figure?triangles=20000").mesh();
    const BuildOptions options = build_options_for(Quality::balanced);
    const WideBvhOptions layout{.compact = true};
    const WideBvh tree = build_wide_bvh(mesh, options, layout),
                  welded(build_bvh(mesh, options), layout), copied = build_wide_bvh(mesh, options);
    EXPECT_LE(tree.arrays().vertices.size(), mesh.vertices.size());
    EXPECT_TRUE(same_bits(tree, welded));
    // As from a file that knows no indices: three vertices a triangle, at the same places.
    Mesh loose;
    for (const Triangle& t : mesh.triangles) {
        const auto first = static_cast<std::uint32_t>(loose.vertices.size());
        for (const std::uint32_t v : t) loose.vertices.push_back(mesh.vertices[v]);
        loose.triangles.push_back({first, first + 1, first + 2});
    }
    EXPECT_TRUE(same_bits(build_wide_bvh(loose, options, layout), tree));
    EXPECT_EQ(tree.stats().nodes, copied.stats().nodes);
    EXPECT_LT(tree.stats().bytes, 0.6 * static_cast<double>(copied.stats().bytes));
}

TEST(WideBuild, OfManyPartsHoldsEveryTriangleInItsBoxes) {
    const Mesh mesh = crowded_mesh();
    const WideBvh tree = build_wide_bvh(mesh);
    Walk walk(tree);
    walk.below(0);
    EXPECT_TRUE(walk.every_node_once());
    EXPECT_EQ(walk.seen.size(), mesh.triangles.size());
    EXPECT_EQ(walk.deepest, tree.stats().max_depth);
}

TEST(WideBuild, StagesMakeUpTheTimeAndThePeakHoldsTheTree) {
    const Mesh mesh = random_soup(20'000, 8);
    for (const Builder builder :
         {Builder::karras, Builder::apetrei, Builder::ploc, Builder::binned, Builder::sweep})
        for (const bool compact : {false, true}) {
            BuildOptions options;
            options.builder = builder;
            const WideBvhStats s = build_wide_bvh(mesh, options, {.compact = compact}).stats();
            const BuildMs& ms = s.stages;
            SCOPED_TRACE(builder_name(builder));
            EXPECT_DOUBLE_EQ(ms.total, s.ms);
            EXPECT_NEAR(ms.bounds + ms.codes + ms.sort + ms.hierarchy + ms.fit + ms.layout,
                        ms.total, 1e-9);
            EXPECT_GE(ms.layout, s.layout_ms);
            EXPECT_GT(ms.sort, 0);
            EXPECT_GE(s.peak_bytes, s.bytes);
        }
    const WideBvhStats s = WideBvh(build_bvh(mesh)).stats();
    EXPECT_EQ(s.stages.layout, s.ms);
    EXPECT_EQ(s.stages.total, s.ms);
    EXPECT_GE(s.peak_bytes, s.bytes);
    const WideBvhStats none = build_wide_bvh(Mesh{}).stats();
    EXPECT_EQ(none.stages.hierarchy, 0);
    EXPECT_EQ(none.bytes, 0u);
}

TEST(WideBuild, LeavesOutWhatIsInvalidOrFlat) {
    Mesh mesh = random_soup(20'000, 8);
    for (std::size_t k = 0; k < 20'000; k += 7) mesh.vertices[mesh.triangles[k][0]].x = NAN;
    for (std::size_t k = 1; k < 20'000; k += 5) mesh.triangles[k][1] = mesh.triangles[k][0];
    const BuildOptions options = build_options_for(Quality::balanced);
    const WideBvh tree = build_wide_bvh(mesh, options);
    EXPECT_EQ(tree.stats().left_out, 2858u);
    EXPECT_TRUE(same_bits(tree, WideBvh(build_bvh(mesh, options))));
    BuildOptions strict = options;
    strict.strict = true;
    WideBvhBuilder builder;
    WideBvh kept = build_wide_bvh(mesh, options);
    EXPECT_THROW(builder.build(mesh, strict, kept), InputError);
    EXPECT_TRUE(kept.empty());
    builder.build(mesh, options, kept);  // and it goes on working
    EXPECT_TRUE(same_bits(tree, kept));
}

TEST(WideBuild, WhatWasMovedFromIsEmptyAndBuildsAgain) {
    const Mesh mesh = random_soup(300, 5);
    WideBvhBuilder builder;
    WideBvh tree;
    builder.build(mesh, {}, tree);
    const WideBvh first = std::move(tree);
    const std::vector<Ray> rays(3, Ray{{0, 0, -9}, 0, {0, 0, 1}, infinity});
    EXPECT_TRUE(tree.empty());
    EXPECT_EQ(tree.stats().references, 0u);
    EXPECT_FALSE(trace(tree, rays)[0].hit());
    EXPECT_FALSE(closest_hit(tree, rays[0]).hit());
    builder.build(mesh, {}, tree);
    EXPECT_TRUE(same_bits(tree, first));
    WideBvhBuilder other = std::move(builder);
    builder.build(mesh, {}, tree);
    EXPECT_TRUE(same_bits(tree, first));
}

TEST(WideBuild, RefusesPointsAndOtherWidths) {
    const std::vector<Vec3> points{{0, 0, 0}, {1, 1, 1}};
    EXPECT_THROW(static_cast<void>(build_wide_bvh(MeshView(points, {}))), InputError);
    WideBvhBuilder builder;
    WideBvh tree;
    EXPECT_THROW(builder.build(random_soup(10, 1), {}, tree, {.width = 5}), InputError);
    EXPECT_TRUE(closest_hit(WideBvh(), Ray{{0, 0, 0}, 0, {0, 0, 1}, infinity}).prim ==
                no_primitive);
}

}  // namespace
}  // namespace raydix::test
