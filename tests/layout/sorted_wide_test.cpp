// Wide trees that are written straight from sorted triangles: every triangle once, in boxes around
// it; the same bytes for every number of threads and every instruction set; the hits of brute
// force.
#include <gtest/gtest.h>
#include <raydix/raydix.h>
#include <raydix/wide.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "keys/host_encode.h"
#include "layout/sorted_part.h"
#include "layout/sorted_top.h"
#include "layout/wide_check.h"
#include "primitives/bounds.h"
#include "sort/radix_sort.h"
#include "support/random.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"
#include "tree/kept_splits.h"

namespace raydix::test {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

bool same_bytes(const auto& a, const auto& b) {
    return std::ranges::equal(std::as_bytes(std::span(a)), std::as_bytes(std::span(b)));
}
bool same_tree(const WideBvh& a, const WideBvh& b) {
    return same_bytes(a.arrays().nodes.view(), b.arrays().nodes.view()) &&
           same_bytes(a.arrays().blocks.view(), b.arrays().blocks.view());
}

struct NamedMesh {
    std::string name;
    Mesh mesh;
};

Mesh copies_of_one(std::size_t count) {
    Mesh mesh = random_soup(1, 3);
    mesh.triangles.resize(count, mesh.triangles[0]);
    return mesh;
}

/// In a row along x, each as long as the row and as thin as floats allow.
Mesh splinters(std::size_t count) {
    Mesh mesh;
    for (std::uint32_t k = 0; k < count; ++k) {
        const float x = static_cast<float>(k), far = static_cast<float>(count);
        mesh.vertices.insert(mesh.vertices.end(), {{x, 0, 0}, {x + far, 1e-6f, 0}, {x, 0, 1e-6f}});
        mesh.triangles.push_back({3 * k, 3 * k + 1, 3 * k + 2});
    }
    return mesh;
}

/// Most in one cell of the grid, and each of the others in a cell half as large as the last: in
/// large ones a leaf for each hangs from the top. Smaller by much, all would be left out.
Mesh halving_cells(std::size_t count) {
    Mesh mesh = scaled(random_soup(count, 7), 0x1p-22f);
    const std::size_t others = std::min<std::size_t>(count / 2, 40);
    for (std::size_t k = 0; k < others; ++k)
        for (const std::uint32_t v : mesh.triangles[k])
            mesh.vertices[v].x += std::ldexp(1.0f, -static_cast<int>(k));
    return mesh;
}

/// Every seventh with NaN, every fifth without area; corners repeated, or on a line.
Mesh spoiled(Mesh mesh) {
    for (std::size_t k = 0; k < mesh.triangles.size(); ++k) {
        Triangle& t = mesh.triangles[k];
        if (k % 7 == 0) mesh.vertices[t[0]].y = nan;
        if (k % 5 == 1) t[1] = t[0];
        if (k % 35 == 3) mesh.vertices[t[2]] = mesh.vertices[t[1]];
    }
    return mesh;
}

Mesh without_area(std::size_t count) {
    Mesh mesh = random_soup(count, 4);
    for (Triangle& t : mesh.triangles) t[2] = t[0];
    return mesh;
}

std::vector<NamedMesh> meshes() {
    std::vector<NamedMesh> all;
    for (const std::size_t size : {0u, 1u, 2u, 3u, 4u, 5u, 8u, 9u, 63u, 64u, 65u, 1000u, 4095u,
                                   4096u, 4097u, 30'000u, 80'000u}) {
        const std::size_t n = size > 4097 ? fewer(size, 8) : size;
        all.push_back({"soup of " + std::to_string(n), random_soup(n, n)});
    }
    for (const std::size_t size : {4u, 5u, 300u, 40'000u}) {
        const std::size_t n = size > 300 ? fewer(size, 8) : size;
        all.push_back({"copies", copies_of_one(n)});
        all.push_back({"splinters", splinters(n)});
        all.push_back({"halving cells", halving_cells(n)});
        all.push_back({"lattice", lattice_mesh(n, 7, n)});
        all.push_back({"spoiled", spoiled(random_soup(n, 8))});
        all.push_back({"without area", without_area(n)});
    }
    all.push_back({"huge", scaled(random_soup(6000, 3), 9e11f)});
    all.push_back({"tiny", scaled(random_soup(6000, 3), 1e-9f)});
    all.push_back({"far away", moved(random_soup(6000, 3), {1e9f, -1e9f, 1e3f})});
    all.push_back(
        {"figure",
         load_model("builtin:figure?triangles=" + std::to_string(fewer(70'000, 3))).mesh()});
    return all;
}

BuildOptions fast(int threads = 0, int bits = 63) {
    BuildOptions options = build_options_for(Quality::fast);
    options.threads = threads;
    options.bits = bits;
    return options;
}

TEST(SortedWide, HoldsEveryTriangleOnceInBoxesAroundIt) {
    WideBvhBuilder builder;  // one for all: what is left in its memory does no harm
    WideBvh tree;
    for (const auto& [name, mesh] : meshes())
        for (const int width : {4, 8})
            for (const int bits : {30, 63}) {
                SCOPED_TRACE(name + ", width " + std::to_string(width));
                builder.build(mesh, fast(3, bits), tree, {.width = width});
                WideBvhStats found;
                const MeshView view(mesh);
                const Fault fault = wide_fault(tree.arrays(), {&view, 1}, found);
                EXPECT_FALSE(fault) << fault.value_or("");
                const WideBvhStats& stats = tree.stats();
                EXPECT_EQ(stats.nodes, found.nodes);
                EXPECT_EQ(stats.leaves, found.leaves);
                EXPECT_EQ(stats.references, found.references);
                EXPECT_EQ(stats.max_depth, found.max_depth);
                EXPECT_EQ(stats.children_per_node, found.children_per_node);
                EXPECT_EQ(stats.bytes, found.bytes);
                EXPECT_EQ(stats.input_count, found.input_count);
                EXPECT_EQ(stats.left_out, found.left_out);
                for (const WideNode& node : tree.arrays().nodes.view())
                    EXPECT_LE(8 - std::ranges::count(node.child, wide_no_child), width);
            }
}

TEST(SortedWide, HasTheLeavesOfTheBinaryTree) {
    for (const auto& [name, mesh] : meshes()) {
        const Bvh binary = build_bvh(mesh, fast());
        std::uint64_t leaves = 0;
        bool flat = false;
        for (const LeafTriangle& t : binary.triangles()) flat = flat || has_zero_area(t);
        if (flat || binary.empty()) continue;
        for (const BvhNode& node : binary.nodes()) leaves += node.is_leaf() ? 1 : 0;
        EXPECT_EQ(build_wide_bvh(mesh, fast()).stats().leaves, leaves) << name;
    }
}

TEST(SortedWide, IsTheSameForEveryThreadCount) {
    for (const auto& [name, mesh] : meshes()) {
        const WideBvh one = build_wide_bvh(mesh, fast(1));
        for (const int threads : {2, 5}) {
            const WideBvh many = build_wide_bvh(mesh, fast(threads));
            EXPECT_TRUE(same_tree(one, many)) << name;
            EXPECT_EQ(one.stats().sah, many.stats().sah) << name;
        }
    }
}

/// Costs no more than a little above the tree that a plan of the binary one gives.
TEST(SortedWide, CostsLittleMoreThanACollapse) {
    for (const char* const name :
         {"builtin:figure?triangles=60000", "builtin:atrium?triangles=60000",
          "builtin:grove?triangles=60000"}) {
        const Mesh mesh = load_model(name).mesh();
        const WideBvh straight = build_wide_bvh(mesh, fast()), planned(build_bvh(mesh, fast()));
        EXPECT_LT(straight.stats().sah, 1.01 * planned.stats().sah) << name;
        EXPECT_LT(straight.stats().nodes, 1.02 * static_cast<double>(planned.stats().nodes))
            << name;
    }
}

TEST(SortedWide, GivesTheHitsOfBruteForce) {
    for (const auto& [name, mesh] : meshes()) {
        if (mesh.triangles.size() > 10'000) continue;
        const WideBvh tree = build_wide_bvh(mesh, fast());
        const Bvh binary = build_bvh(mesh, fast());
        const Aabb box = binary.empty() ? Aabb{{0, 0, 0}, {1, 1, 1}} : binary.bounds();
        Random random(20140101);
        std::vector<Ray> rays;
        const Vec3 size = box.hi - box.lo;
        const auto place = [&](float margin) {
            const auto part = [&] { return random.between(-margin, 1 + margin); };
            return Vec3{box.lo.x + part() * size.x, box.lo.y + part() * size.y,
                        box.lo.z + part() * size.z};
        };
        for (int k = 0; k < 300; ++k) {
            const Vec3 from = place(0.3f), to = place(0.0f);
            rays.push_back({from, 0, to - from, infinity});
        }
        const std::vector<Hit> wanted = trace_brute_force(mesh, rays), found = trace(tree, rays);
        EXPECT_TRUE(same_bytes(wanted, found)) << name;
    }
}

/// The same steps as make_wide_layout, by hand.
struct Sorted {
    explicit Sorted(const Mesh& mesh)
        : source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()},
          keys(mesh.triangles.size()),
          order(mesh.triangles.size()),
          bounds(scene_bounds(source, static_cast<std::uint32_t>(mesh.triangles.size())).box) {
        host_encode(source, make_grid(bounds, CodeFormat<std::uint64_t>::axis_bits), true,
                    keys.size(), keys.data());
        SortScratch<std::uint64_t> scratch;
        sort_keys(keys.span(), order.span(), 63, scratch);
    }
    [[nodiscard]] NeighbourPrefixes prefixes() {
        return NeighbourPrefixes(
            SortedKeys<std::uint64_t>{keys.data(), static_cast<std::uint32_t>(keys.size())},
            memory);
    }
    TriangleSource source;
    Buffer<std::uint64_t> keys;
    Buffer<std::uint32_t> order;
    Aabb bounds;
    Buffer<std::uint8_t> memory;
};

TEST(SortedTop, DividesAllKeysAmongItsParts) {
    for (const Mesh& mesh : {random_soup(3, 1), random_soup(100, 1), random_soup(150'000, 1),
                             halving_cells(70'000), copies_of_one(90'000)})
        for (const std::uint32_t width : {4u, 8u}) {
            Sorted sorted(mesh);
            TopBuffers memory;
            const NeighbourPrefixes prefixes = sorted.prefixes();
            const SortedTop top = make_sorted_top(
                {prefixes, sorted.order.view(), sorted.source, sorted.bounds}, width, 4, memory);
            std::vector<std::uint32_t> children(top.nodes.size());
            std::uint32_t end = 0;
            for (const SortedPart& part : top.parts) {
                EXPECT_EQ(part.begin, end);
                EXPECT_LT(part.begin, part.end);
                EXPECT_LE(part.end - part.begin, most_in_part);
                end = part.end;
                // A subtree: all prefixes inside are longer than those at its ends.
                const std::uint8_t outside = std::max(*prefixes.at(std::int64_t{part.begin} - 1),
                                                      *prefixes.at(std::int64_t{part.end} - 1));
                for (std::uint32_t k = part.begin; k + 1 < part.end; ++k)
                    EXPECT_GT(*prefixes.at(k), outside);
                if (part.parent.node != TopSlot::no_node) ++children.at(part.parent.node);
            }
            EXPECT_EQ(end, mesh.triangles.size());
            for (std::size_t w = 0; w < top.nodes.size(); ++w) {
                const SortedTop::Node& node = top.nodes[w];
                if (w == 0) continue;
                EXPECT_LT(node.parent.node, w);
                EXPECT_EQ(node.depth, top.nodes[node.parent.node].depth + 1);
                ++children.at(node.parent.node);
            }
            for (std::size_t w = 0; w < top.nodes.size(); ++w) {
                EXPECT_EQ(children[w], top.nodes[w].children);
                EXPECT_LE(children[w], width);
            }
        }
}

TEST(PartKernels, WriteTheSameBytes) {
    const Mesh mesh = load_model("builtin:figure?triangles=5000").mesh();
    Sorted sorted(mesh);
    const NeighbourPrefixes prefixes = sorted.prefixes();
    Buffer<std::uint64_t> kept;
    Buffer<std::uint32_t> before;
    mark_kept_splits(prefixes, prefixes.count() - 1, 4, kept, before);
    const SortedTriangles triangles{prefixes, sorted.order.view(), sorted.source, sorted.bounds};
    const ProgressCounter progress(1);
    const PartInput in{triangles, kept.data(), center_of(sorted.bounds), progress};
    const SortedPart whole{
        0, static_cast<std::uint32_t>(prefixes.count()), {TopSlot::no_node, 0}, 0};
    const auto write = [&](const PartKernel& kernel, bool wide) {
        WidePart out;
        std::vector<TriangleBlock> blocks(prefixes.count());
        PartRoot root;
        const PartGroup group{{&whole, 1}, {&root, 1}, blocks.data()};
        PartEntries<4> entries4;
        PartEntries<8> entries8;
        wide ? kernel.write8(in, group, entries8, out) : kernel.write4(in, group, entries4, out);
        blocks.resize(out.filler.blocks());
        return std::pair(std::move(out.nodes), std::move(blocks));
    };
    for (const bool wide : {false, true}) {
        const auto wanted = write(part_kernels().front(), wide);
        EXPECT_GT(wanted.first.size(), 100u);
        for (const PartKernel& kernel : part_kernels()) {
            const auto found = write(kernel, wide);
            EXPECT_TRUE(same_bytes(wanted.first, found.first)) << kernel.isa;
            EXPECT_TRUE(same_bytes(wanted.second, found.second)) << kernel.isa;
        }
    }
}

TEST(ZeroArea, FloatsNeverDecideOtherwiseThanDoubles) {
    Random random(11);
    for (int k = 0; k < 20'000; ++k) {
        const float scale = std::ldexp(1.0f, static_cast<int>(random.between(-60.0f, 39.0f)));
        const auto place = [&] {
            return Vec3{random.between(-1, 1) * scale, random.between(-1, 1) * scale,
                        random.between(-1, 1) * scale};
        };
        const Vec3 a = place(), b = place();
        Vec3 c = place();
        // On the line through both, but for roundings; or beside it by as little.
        if (k % 2 == 0) c = a + (b - a) * random.between(-2, 2);
        if (k % 4 == 0) c.x = std::nextafterf(c.x, 0.0f);
        const Vec3 corners[3] = {a, b, k % 8 == 1 ? a : c};
        const Triangle triangle{0, 1, 2};
        const TriangleSource source{corners, &triangle, 3};
        EXPECT_EQ(host_zero_area(source, 0), has_zero_area(source.corners(0))) << k;
    }
}

}  // namespace
}  // namespace raydix::test
