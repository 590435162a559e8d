// check(Octree): good trees pass, and every planted fault is named.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/octree.h>

#include <functional>

#include "support/octree_inputs.h"
#include "support/support.h"
#include "tree/octree_internals.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t octree_check_seed = 9;

Octree sample() {
    return build_octree(random_soup(300, octree_check_seed), {.max_level = 6, .max_leaf = 3});
}

TEST(OctreeCheck, BuiltTreesKeepEveryInvariant) {
    for (const NamedPoints& input : octree_inputs(500, octree_check_seed))
        for (const int bits : {30, 63})
            for (const int max_level : {-1, 0, 4})
                for (const int max_leaf : {1, 6}) {
                    const Octree octree = build_octree(
                        input.points, {.bits = bits, .max_level = max_level, .max_leaf = max_leaf});
                    EXPECT_EQ(check(octree).broken, "") << input.name;
                    const CheckReport report = check(octree, MeshView(input.points, {}));
                    EXPECT_EQ(report.broken, "") << input.name;
                    EXPECT_TRUE(report.ok);
                    EXPECT_EQ(report.nodes, octree.nodes().size());
                    EXPECT_EQ(report.primitives, octree.order().size());
                }
    Mesh mesh = random_soup(300, octree_check_seed);
    mesh.vertices[5].y = infinity;
    EXPECT_EQ(check(build_octree(mesh), mesh).broken, "");
}

struct PlantedFault {
    const char* part;  // what the report begins with
    std::function<void(OctreeInternals)> plant;
};

std::uint32_t first_leaf(OctreeInternals t) {
    std::uint32_t i = 0;
    while (!t.nodes()[i].is_leaf()) ++i;
    return i;
}

std::vector<PlantedFault> faults() {
    using Access = OctreeInternals;
    return {
        {"info:", [](Access t) { t.options().bits = 31; }},
        {"info:", [](Access t) { t.options().max_level = 22; }},
        {"info:", [](Access t) { t.options().max_leaf = 0; }},
        {"info:", [](Access t) { t.kind() = PrimitiveKind::boxes; }},
        {"info:", [](Access t) { t.input_count() += 1; }},
        {"info:", [](Access t) { t.bounds().lo.x = infinity; }},
        {"info:", [](Access t) { t.level_begin()[2] += 1; }},
        {"points:", [](Access t) { t.points().reset(299); }},
        {"points:", [](Access t) { t.points()[7].x = 4; }},
        {"points:", [](Access t) { t.points()[7].z = std::numeric_limits<float>::quiet_NaN(); }},
        {"nodes:", [](Access t) { t.nodes().reset(0); }},
        {"nodes: node 0", [](Access t) { t.nodes()[0].level = 1; }},
        {"nodes: node 0", [](Access t) { t.nodes()[0].parent = 0; }},
        {"nodes: node 0", [](Access t) { t.nodes()[0].point_count -= 1; }},
        {"nodes: node 0", [](Access t) { t.nodes()[0].first_child = 2; }},
        {"nodes: node 0", [](Access t) { t.nodes()[0].child_mask |= 0x100; }},
        {"nodes:", [](Access t) { t.nodes()[0].child_mask &= t.nodes()[0].child_mask - 1; }},
        {"nodes:", [](Access t) { std::swap(t.nodes()[1], t.nodes()[2]); }},
        {"nodes:", [](Access t) { t.nodes()[3].parent = 1; }},
        {"nodes:", [](Access t) { t.nodes()[3].level = 7; }},
        {"nodes:", [](Access t) { t.nodes()[3].level = 0xFFFFFFFF; }},
        {"nodes:", [](Access t) { t.nodes()[2].first_point += 1; }},
        {"nodes:", [](Access t) { t.nodes()[2].point_count = 0xFFFFFFF0; }},
        {"nodes:", [](Access t) { t.nodes()[t.nodes().size() - 1].code ^= 1; }},
        {"nodes:", [](Access t) { t.nodes()[first_leaf(t)].child_mask = 1; }},
        {"nodes:", [](Access t) { t.nodes()[first_leaf(t)].first_child = 1; }},
        {"nodes:", [](Access t) { t.nodes()[first_leaf(t)].point_count = 0; }},
        {"nodes:", [](Access t) { t.options().max_leaf = 2; }},
        {"nodes:", [](Access t) { t.options().max_leaf = 4; }},
        {"nodes:", [](Access t) { t.options().max_level = 3; }},
        {"info:", [](Access t) { t.nodes().reset(t.nodes().size() - 1); }},
        {"order:", [](Access t) { t.order()[4] = 300; }},
        {"order:", [](Access t) { t.order()[4] = t.order()[5]; }},
        {"order:",
         [](Access t) {  // a point leaves its place
             std::swap(t.points()[0], t.points()[299]);
         }},
        {"order:", [](Access t) { t.bounds().hi.x = 3; }},
    };
}

TEST(OctreeCheck, NamesEveryPlantedFault) {
    std::size_t number = 0;
    for (const PlantedFault& fault : faults()) {
        Octree octree = sample();
        ASSERT_EQ(check(octree).broken, "");
        ASSERT_GT(octree.level_count(), 3u);
        fault.plant(OctreeInternals{octree});
        const CheckReport report = check(octree);
        EXPECT_FALSE(report.ok) << "fault " << number;
        EXPECT_EQ(report.broken.rfind(fault.part, 0), 0u)
            << "fault " << number << ": " << report.broken;
        ++number;
    }
}

TEST(OctreeCheck, AMeshIsTheOneItWasBuiltFrom) {
    const Mesh mesh = random_soup(300, octree_check_seed);
    const Octree octree = build_octree(mesh, {.max_level = 6, .max_leaf = 3});
    EXPECT_EQ(check(octree, mesh).broken, "");
    Mesh other = mesh;
    other.triangles.pop_back();
    EXPECT_FALSE(check(octree, other).ok);
    other = mesh;
    other.vertices[10].x += 10;
    EXPECT_FALSE(check(octree, other).ok);
    other = mesh;
    std::swap(other.triangles[3], other.triangles[4]);
    EXPECT_EQ(check(octree, other).broken.rfind("points: ", 0), 0u);
    other = mesh;
    other.triangles[0][1] = 900;
    EXPECT_FALSE(check(octree, other).ok);
    other = mesh;
    other.triangles.clear();
    EXPECT_FALSE(check(octree, other).ok);
    other = mesh;
    other.vertices[mesh.triangles[9][0]].x = infinity;
    EXPECT_FALSE(check(octree, other).ok);
}

TEST(OctreeCheck, HashesTellTreesApart) {
    const auto hash = [](std::span<const Vec3> points, const OctreeOptions& options) {
        return tree_hash(build_octree(points, options));
    };
    std::vector<Vec3> points = octree_inputs(200, octree_check_seed)[5].points;
    const OctreeOptions options{.max_level = 6, .max_leaf = 2};
    const std::string first = hash(points, options);
    EXPECT_EQ(first.size(), 32u);
    EXPECT_EQ(hash(points, {.max_level = 6, .max_leaf = 2, .threads = 3}), first);
    EXPECT_NE(hash(points, {.bits = 30, .max_level = 6, .max_leaf = 2}), first);
    EXPECT_NE(hash(points, {.max_level = 7, .max_leaf = 2}), first);
    EXPECT_NE(hash(points, {.max_level = 6, .max_leaf = 3}), first);
    std::swap(points[0], points[1]);
    EXPECT_NE(hash(points, options), first);
    std::swap(points[0], points[1]);
    for (Vec3& p : points) p.x += 1;  // the same cells, elsewhere
    EXPECT_NE(hash(points, options), first);
    EXPECT_NE(hash({}, options), first);
}

TEST(OctreeCheck, OptionsAndInputOutOfRange) {
    const std::vector<Vec3> one{{1, 2, 3}};
    const auto refused = [&](const OctreeOptions& options) {
        EXPECT_THROW((void)build_octree(one, options), InputError);
    };
    refused({.bits = 62});
    refused({.max_level = 22});
    refused({.bits = 30, .max_level = 11});
    refused({.max_level = -2});
    refused({.max_leaf = 0});
    const std::vector<Vec3> bad{{1, 2, 3}, {infinity, 0, 0}};
    EXPECT_THROW((void)build_octree(bad, {.strict = true}), InputError);
    EXPECT_EQ(build_octree(bad).left_out(), 1u);
    Mesh mesh = random_soup(5, 1);
    mesh.triangles[2][1] = 99;
    EXPECT_THROW((void)build_octree(mesh), InputError);
    EXPECT_EQ(build_octree(one).options().max_level, 21);
    EXPECT_EQ(build_octree(one, {.bits = 30}).options().max_level, 10);
    EXPECT_EQ(build_octree(one, {.max_leaf = 2'000'000'000}).nodes().size(), 1u);
}

/// A triangle stands at the centre of its box.
TEST(OctreeCheck, TrianglesStandAtTheCentresOfTheirBoxes) {
    const Mesh mesh = random_soup(100, octree_check_seed);
    const Octree octree = build_octree(mesh);
    EXPECT_EQ(octree.kind(), PrimitiveKind::triangles);
    for (std::size_t k = 0; k < octree.order().size(); ++k) {
        const Triangle& t = mesh.triangles[octree.order()[k]];
        const auto middle = [&](float Vec3::*axis) {
            const auto [lo, hi] = std::minmax(
                {mesh.vertices[t[0]].*axis, mesh.vertices[t[1]].*axis, mesh.vertices[t[2]].*axis});
            return 0.5f * (lo + hi);
        };
        EXPECT_EQ(octree.points()[k].x, middle(&Vec3::x));
        EXPECT_EQ(octree.points()[k].y, middle(&Vec3::y));
        EXPECT_EQ(octree.points()[k].z, middle(&Vec3::z));
    }
}

TEST(OctreeCheck, ATreeThatWasNeverBuiltIsEmpty) {
    EXPECT_EQ(check(Octree()).broken, "");
    EXPECT_EQ(tree_hash(Octree()), tree_hash(build_octree(Mesh{})));
}

}  // namespace
}  // namespace raydix::test
