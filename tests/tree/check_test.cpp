// Each kind of fault is planted once and must be named; garbage of every kind must be survived.
#include <gtest/gtest.h>
#include <raydix/check.h>

#include <bit>
#include <cstring>
#include <functional>

#include "support/reference_tree.h"
#include "support/support.h"
#include "tree/bvh_internals.h"

namespace raydix::test {
namespace {

constexpr std::uint32_t triangle_count = 200;

Mesh sound_mesh() { return random_soup(triangle_count, 21); }

struct Planted {
    const char* fault;
    const char* named;  // must occur in the report
    std::function<void(const BvhInternals&)> plant;
};

/// The lowest slot from 2 on that fits.
template <class Fits>
std::size_t find_node(const BvhInternals& tree, const Fits& fits) {
    for (std::size_t i = 2; i < tree.nodes().size(); ++i)
        if (fits(tree.nodes()[i])) return i;
    ADD_FAILURE() << "no such node";
    return 0;
}
std::size_t some_leaf(const BvhInternals& tree) {
    return find_node(tree, [](const BvhNode& n) { return n.is_leaf(); });
}
std::size_t large_leaf(const BvhInternals& tree) {
    return find_node(tree, [](const BvhNode& n) { return n.count > 1; });
}
std::size_t some_inner(const BvhInternals& tree) {
    return find_node(tree, [](const BvhNode& n) { return !n.is_leaf(); });
}
float next(float x) { return std::nextafter(x, infinity); }

std::vector<Planted> planted_in_links() {
    return {
        {"children swapped", "starts at position",
         [](auto& t) { std::swap(t.nodes()[2], t.nodes()[3]); }},
        {"cycle", "a cycle or a shared subtree",
         [](auto& t) { t.nodes()[some_inner(t)].first = t.nodes()[0].first; }},
        {"node is its own child", "a cycle or a shared subtree",
         [](auto& t) {
             const std::size_t i = some_inner(t);
             t.nodes()[i].first = static_cast<std::uint32_t>(i & ~std::size_t{1});
         }},
        {"child out of range", "has its children at slot 4294967294 of",
         [](auto& t) { t.nodes()[some_inner(t)].first = 0xFFFFFFFEu; }},
        {"child just past the end", "has its children at slot",
         [](auto& t) {
             t.nodes()[some_inner(t)].first = static_cast<std::uint32_t>(t.nodes().size());
         }},
        {"odd child", "which is no pair's", [](auto& t) { t.nodes()[some_inner(t)].first += 1; }},
        {"child is the root", "which is no pair's",
         [](auto& t) { t.nodes()[some_inner(t)].first = 0; }},
        {"padding used", "slot 1 is padding", [](auto& t) { t.nodes()[1].hi.y = -0.0f; }},
        {"leaf starts late", "the leaves before it end at",
         [](auto& t) { ++t.nodes()[some_leaf(t)].first; }},
        {"leaf too long", "holds 255 primitives, but max_leaf is 4",
         [](auto& t) { t.nodes()[some_leaf(t)].count = 255; }},
        {"leaf one shorter", "the leaves before it end at",
         [](auto& t) { --t.nodes()[large_leaf(t)].count; }},
        {"inner node made a leaf", "nodes: leaf",
         [](auto& t) { t.nodes()[some_inner(t)].count = 2; }},
        {"leaf made an inner node", "nodes: inner node",
         [](auto& t) { t.nodes()[some_leaf(t)].count = 0; }},
        {"depth too small", "depth", [](auto& t) { --t.max_depth(); }},
        {"depth too large", "depth", [](auto& t) { ++t.max_depth(); }},
        {"inner count", "slots, but", [](auto& t) { ++t.inner_count(); }},
        {"nodes missing", "slots, but", [](auto& t) { t.nodes().reset(t.nodes().size() - 2); }},
        {"not collapsed", "a leaf may hold 255", [](auto& t) { t.options().max_leaf = 255; }},
    };
}

std::vector<Planted> planted_in_geometry() {
    return {
        {"box widened", "but what it holds spans",
         [](auto& t) { t.nodes()[some_leaf(t)].hi.x = next(t.nodes()[some_leaf(t)].hi.x); }},
        {"box narrowed", "but what it holds spans",
         [](auto& t) { t.nodes()[some_inner(t)].lo.z = next(t.nodes()[some_inner(t)].lo.z); }},
        {"root widened", "the box of inner node 0", [](auto& t) { t.nodes()[0].hi.z = 1e12f; }},
        {"box NaN", "nan", [](auto& t) { t.nodes()[some_leaf(t)].lo.y = std::nanf(""); }},
        {"corner moved", "but what it holds spans", [](auto& t) { t.triangles()[7].v1.x = 3; }},
        {"corner infinite", "belongs in no tree",
         [](auto& t) { t.triangles()[7].v1.x = infinity; }},
        {"corner too far", "belongs in no tree", [](auto& t) { t.triangles()[7].v1.x = 2e12f; }},
        {"corner -0", "belongs in no tree", [](auto& t) { t.triangles()[7].v0.y = -0.0f; }},
        {"too small to be in a tree", "belongs in no tree",
         [](auto& t) {
             t.triangles()[7] = {{0, 0, 0}, {0, 1e-13f, 0}, {0, 0, 1e-14f}};
         }},
    };
}

std::vector<Planted> planted_in_numbers() {
    return {
        {"primitive twice", "order: primitive", [](auto& t) { t.order()[3] = t.order()[9]; }},
        {"primitive out of range", "names primitive 200 of 200",
         [](auto& t) { t.order()[3] = triangle_count; }},
        {"primitive missing", "references", [](auto& t) { t.order().reset(t.order().size() - 1); }},
        {"more left out than given", "left out", [](auto& t) { t.left_out() = 1u << 20; }},
        {"one said to be left out", "1 left out", [](auto& t) { t.left_out() = 1; }},
        {"absurd input", "more than a tree can hold",
         [](auto& t) {
             t.left_out() = (t.input_count() = std::uint64_t{1} << 40) - triangle_count;
         }},
        {"bits", "31 code bits", [](auto& t) { t.options().bits = 31; }},
        {"max_leaf 0", "max_leaf 0", [](auto& t) { t.options().max_leaf = 0; }},
        {"max_leaf 256", "max_leaf 256", [](auto& t) { t.options().max_leaf = 256; }},
        {"builder", "builder number 77",
         [](auto& t) { t.options().builder = static_cast<Builder>(77); }},
        {"kind", "primitives", [](auto& t) { t.kind() = PrimitiveKind::boxes; }},
        {"no such kind", "kind 9", [](auto& t) { t.kind() = static_cast<PrimitiveKind>(9); }},
        {"triangles missing", "primitives", [](auto& t) { t.triangles().reset(3); }},
        {"boxes beside triangles", "primitives", [](auto& t) { t.boxes().reset(triangle_count); }},
    };
}

TEST(Check, EachPlantedFaultIsNamed) {
    const Mesh mesh = sound_mesh();
    for (const auto& group : {planted_in_links(), planted_in_geometry(), planted_in_numbers()}) {
        for (const Planted& planted : group) {
            Bvh bvh = build_bvh(mesh);
            ASSERT_EQ(check(bvh).broken, "");
            planted.plant(BvhInternals{bvh});
            const CheckReport report = check(bvh);
            EXPECT_FALSE(report.ok) << planted.fault;
            EXPECT_NE(report.broken.find(planted.named), std::string::npos)
                << planted.fault << ": " << report.broken;
        }
    }
}

TEST(Check, OrderOfEqualCodes) {
    const std::vector<Vec3> points(6, Vec3{1, 1, 1});
    Bvh bvh = build_bvh(points, {.max_leaf = 2});
    ASSERT_TRUE(check(bvh).ok);
    std::swap(BvhInternals{bvh}.order()[0], BvhInternals{bvh}.order()[1]);
    EXPECT_NE(check(bvh).broken.find("do not ascend"), std::string::npos) << check(bvh).broken;
}

TEST(Check, SplitAtTheWrongPlace) {
    // Codes 0, 1 | 6, 7 on a line; split by hand after the first instead of after the second.
    const std::vector<Vec3> points{{0, 0, 0}, {1, 0, 0}, {6, 0, 0}, {7, 0, 0}};
    Bvh bvh = build_bvh(points, {.max_leaf = 3});
    ASSERT_TRUE(check(bvh).ok);
    auto& nodes = BvhInternals{bvh}.nodes();
    ASSERT_EQ(nodes.size(), 4u);
    nodes[2] = {points[0], 0, points[0], 1};
    nodes[3] = {points[1], 1, points[3], 3};
    EXPECT_NE(check(bvh).broken.find("splits at position 1"), std::string::npos)
        << check(bvh).broken;
}

TEST(Check, AgainstTheMesh) {
    Mesh mesh = sound_mesh();
    mesh.vertices[30].z = infinity;
    mesh.vertices[60] = {-0.0f, -0.0f, 0.5f};
    const Bvh bvh = build_bvh(mesh);
    EXPECT_EQ(bvh.left_out(), 1u);
    EXPECT_EQ(check(bvh, mesh).broken, "");
    EXPECT_EQ(check(bvh, mesh).primitives, triangle_count - 1);
    EXPECT_EQ(check(bvh, mesh).nodes, 2u * bvh.inner_count() + 1);

    const auto broken_by = [&](const std::function<void(Mesh&)>& change) {
        Mesh other = mesh;
        change(other);
        return check(bvh, other).broken;
    };
    EXPECT_NE(broken_by([](Mesh& m) {
                  m.vertices[100].x += 1;
              }).find("not what the mesh holds as number 33"),
              std::string::npos);
    EXPECT_NE(broken_by([](Mesh& m) { m.vertices[30].z = 0; }).find("primitive 10 is left out"),
              std::string::npos);
    EXPECT_NE(broken_by([](Mesh& m) {
                  m.triangles[4][1] = 600;
              }).find("triangle 4 has the vertices 12 600 14 of 600"),
              std::string::npos);
    EXPECT_NE(broken_by([](Mesh& m) {
                  m.triangles.pop_back();
              }).find("200 triangles, but a mesh with 199"),
              std::string::npos);
    EXPECT_NE(
        broken_by([](Mesh& m) { m.triangles.clear(); }).find("200 triangles, but a mesh with 0"),
        std::string::npos);
}

TEST(Check, PointsAndBoxes) {
    Mesh cloud = sound_mesh();
    cloud.triangles.clear();
    const Bvh points = build_bvh(cloud);
    EXPECT_EQ(check(points, cloud).broken, "");
    cloud.vertices[5].x = 9;
    EXPECT_NE(check(points, cloud).broken.find("as number 5"), std::string::npos);
    EXPECT_NE(check(points, sound_mesh()).broken.find("a tree of points"), std::string::npos);

    const std::vector<Aabb> boxes{{{0, 0, 0}, {1, 1, 1}}, {{3, 0, 0}, {4, 1, 1}}};
    Bvh of_boxes = build_bvh(boxes);
    EXPECT_EQ(check(of_boxes, Mesh{}).broken, "");
    BvhInternals{of_boxes}.boxes()[0].hi.x = -1;
    EXPECT_NE(check(of_boxes).broken.find("belongs in no tree"), std::string::npos);
}

TEST(Check, FewReferencesToManyPrimitives) {
    std::vector<Aabb> boxes(100'000, Aabb{{1, 0, 0}, {0, 0, 0}});
    boxes[7] = boxes[99'999] = {{0, 0, 0}, {1, 1, 1}};
    Bvh bvh = build_bvh(boxes);
    ASSERT_EQ(bvh.order().size(), 2u);
    EXPECT_EQ(check(bvh).broken, "");
    BvhInternals{bvh}.order()[1] = 7;
    EXPECT_NE(check(bvh).broken.find("primitive 7 stands in more than one place"),
              std::string::npos);
}

TEST(Check, EmptyTree) {
    Bvh bvh = build_bvh(Mesh{});
    EXPECT_EQ(check(bvh, Mesh{}).broken, "");
    BvhInternals{bvh}.max_depth() = 1;
    EXPECT_NE(check(bvh).broken.find("empty tree"), std::string::npos);
}

TEST(Check, RandomWordsAreSurvivedAndFound) {
    const Mesh mesh = sound_mesh();
    std::mt19937_64 random(99);
    for (std::size_t round = 0; round < 500 * thorough; ++round) {
        Bvh bvh = build_bvh(mesh, {.max_leaf = round % 2 == 0 ? 1 : 4, .threads = 1});
        const BvhInternals tree{bvh};
        const std::string before = tree_hash(bvh);
        for (std::uint64_t k = 0; k <= random() % 4; ++k) {
            auto* words = reinterpret_cast<unsigned char*>(tree.nodes().data());
            const std::size_t at = random() % (tree.nodes().size() * 8) * 4;
            const std::uint32_t pick = random() % 3 == 0
                                           ? static_cast<std::uint32_t>(random())
                                           : static_cast<std::uint32_t>(random() % 500);
            std::memcpy(words + at, &pick, 4);
        }
        const bool ok = check(bvh).ok;  // also ok when a word was overwritten by itself
        if (ok) {
            EXPECT_EQ(tree_hash(bvh), before);
        }
    }
}

TEST(CheckSame, NamesTheFirstDifference) {
    const Mesh mesh = sound_mesh();
    const Bvh bvh = build_bvh(mesh);
    EXPECT_EQ(check_same(bvh, build_bvh(mesh, {.threads = 2})).broken, "");
    EXPECT_EQ(check_same(bvh, reference_tree(MeshView(mesh))).broken, "");
    EXPECT_EQ(check_same(bvh, build_bvh(mesh, {.bits = 30})).broken, "code bits: 63 / 30");
    EXPECT_EQ(check_same(bvh, build_bvh(mesh, {.max_leaf = 1})).broken, "max_leaf: 4 / 1");
    EXPECT_EQ(check_same(bvh, build_bvh(random_soup(100, 1))).broken,
              "primitives given: 200 / 100");

    const auto broken_by = [&](const std::function<void(const BvhInternals&)>& change) {
        Bvh other = build_bvh(mesh);
        change(BvhInternals{other});
        return check_same(bvh, other).broken;
    };
    EXPECT_EQ(broken_by([](auto& t) { t.nodes()[0].lo.x -= 1; }), "nodes 0 / 0: boxes differ");
    EXPECT_EQ(broken_by([](auto& t) { t.triangles()[8].v2.x = 0; }),
              "leaf triangles differ first at position 8");
    EXPECT_EQ(broken_by([](auto& t) { std::swap(t.order()[5], t.order()[6]); }),
              "orders differ first at position 5");
    EXPECT_NE(broken_by([](auto& t) { t.nodes()[large_leaf(t)].count -= 1; }).find("count"),
              std::string::npos);
}

}  // namespace
}  // namespace raydix::test
