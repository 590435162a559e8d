// Trees in double: boxes that hold their triangles in exact arithmetic, input that is left out,
// refits.
#include <gtest/gtest.h>
#include <raydix/check.h>
#include <raydix/raydix.h>

#include <algorithm>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "support/double_scenes.h"
#include "support/exact.h"
#include "support/message.h"
#include "support/sanitized.h"
#include "support/support.h"
#include "tree/around_center.h"
#include "tree/early_splits.h"
#include "tree/spatial_split.h"

namespace raydix::test {
namespace {

constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

struct Place {
    ExactPoint center;
    Exact scale;
};

void expect_inside(const Place& place, Vec3d p, const BvhNode& node) {
    const ExactPoint at = exact(p) - place.center;
    const auto within = [&](const Exact& x, float lo, float hi) {
        return Exact(lo) <= x * place.scale && x * place.scale <= Exact(hi);
    };
    EXPECT_TRUE(within(at.x, node.lo.x, node.hi.x) && within(at.y, node.lo.y, node.hi.y) &&
                within(at.z, node.lo.z, node.hi.z));
}

/// Every leaf's box holds its triangles with no rounding, and every parent's its children.
void expect_outward(const BvhD& bvh) {
    const Place place{exact(bvh.center()), Exact(bvh.scale())};
    std::vector<std::uint32_t> slots{0};
    std::size_t seen = 0;
    while (!slots.empty()) {
        const BvhNode& node = bvh.tree().nodes()[slots.back()];
        slots.pop_back();
        if (!node.is_leaf()) slots.insert(slots.end(), {node.first, node.first + 1});
        for (std::uint32_t k = node.first; k < node.first + node.count; ++k, ++seen) {
            if (sanitized && k % 8 != 0 && bvh.order().size() > 1000) continue;
            for (const Vec3d& p :
                 {bvh.triangles()[k].v0, bvh.triangles()[k].v1, bvh.triangles()[k].v2})
                expect_inside(place, p, node);
        }
    }
    EXPECT_EQ(seen, bvh.input_count() - bvh.left_out());
    const CheckReport report = check(bvh.tree());
    EXPECT_TRUE(report.ok) << report.broken;
}

TEST(BuildDouble, BoxesHoldTheirTrianglesExactly) {
    for (const MeshD& mesh :
         {random_soup_d(fewer(300, 3), 1),
          in_double(random_soup(fewer(300, 3), 2), 100.0, utm_place),
          in_double(random_soup(fewer(300, 3), 3), 1.8e12, {-0.9e12, -0.9e12, -0.9e12}),
          in_double(random_soup(fewer(300, 3), 4), 1e-6, {1e5, -2e5, 3e5}),
          in_double(random_soup(fewer(300, 3), 5), 1e-10)})
        for (const Builder builder : {Builder::karras, Builder::hploc, Builder::binned})
            expect_outward(build_bvh(mesh, {.builder = builder, .max_leaf = 1}));
}

TEST(BuildDouble, TheWholeRangeOfCoordinates) {
    const MeshD mesh{"",
                     {{-1e12, -1e12, -1e12}, {1e12, 1e12, 1e12}, {1e12, -1e12, 1e12}, {0, 0, 1}},
                     {{0, 1, 2}, {1, 2, 3}}};
    const BvhD bvh = build_bvh(mesh);
    EXPECT_EQ(bvh.left_out(), 0u);
    EXPECT_EQ(bvh.scale(), 0.25);
    expect_outward(bvh);
    EXPECT_TRUE(closest_hit(bvh, {{1e12, 0, -1e12}, 0.0, {-1, 0, 1}}).hit());
}

/// A forgotten vertex at 0, as files of maps have it.
TEST(BuildDouble, OneStrayTriangleDoesNotMoveTheCenter) {
    MeshD mesh = in_double(random_soup(5000, 10), 1.0, utm_place);
    const std::vector<RayD> rays = mixed_rays(mesh, 200 * thorough, 5);
    std::vector<HitD> wanted(rays.size()), hits(rays.size());
    const BuildOptions by_area{
        .builder = Builder::sweep};  // one grid of codes over all would be too coarse
    const TraceCounts work = trace(build_bvh(mesh, by_area), rays, wanted, {.counters = true});
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), {{0, 0, 0}, {0, 0, 1}, {0, 1, 0}});
    mesh.triangles.insert(mesh.triangles.begin() + 2500, {first, first + 1, first + 2});
    const BvhD bvh = build_bvh(mesh, by_area);
    EXPECT_LT(bvh.center().x - utm_place.x, 1.0);
    EXPECT_GT(bvh.center().x - utm_place.x, 0.0);
    expect_outward(bvh);
    const TraceCounts with_stray = trace(bvh, rays, hits, {.counters = true});
    EXPECT_LT(with_stray.node_visits, work.node_visits * 3 / 2);
    EXPECT_EQ(with_stray.hits, work.hits);
}

/// Where every triangle that is asked for the center is invalid, the box's middle serves.
TEST(BuildDouble, TheCenterIsInTheBoxWhateverIsLeftOut) {
    MeshD mesh = in_double(random_soup(2048, 11), 1.0, utm_place);
    for (std::size_t i = 0; i < 2048; i += 2) mesh.vertices[mesh.triangles[i][0]].x = nan;
    const BvhD bvh = build_bvh(mesh);
    EXPECT_EQ(bvh.left_out(), 1024u);
    EXPECT_TRUE(bvh.bounds().lo.x <= bvh.center().x && bvh.center().x <= bvh.bounds().hi.x);
    expect_outward(bvh);
}

TEST(BuildDouble, WhatIsNotValidIsLeftOut) {
    MeshD mesh = random_soup_d(20, 6);
    mesh.vertices[3 * 4].x = nan;
    mesh.vertices[3 * 5 + 1].y = inf;
    mesh.vertices[3 * 6 + 2].z = 1.0000001e12;
    const Vec3d at{7.0, 7.0, 7e-14};
    mesh.vertices[3 * 8] = mesh.vertices[3 * 8 + 1] = mesh.vertices[3 * 8 + 2] = at;
    mesh.vertices[3 * 8].z = 0.0;  // too small a box
    for (std::size_t k = 0; k < 3; ++k) mesh.vertices[3 * 9 + k] = {0.3, -0.0, 1e-200};  // a point
    const BvhD bvh = build_bvh(mesh);
    EXPECT_EQ(bvh.input_count(), 20u);
    EXPECT_EQ(bvh.left_out(), 4u);
    EXPECT_EQ(bvh.order().size(), 16u);
    EXPECT_GT(bvh.bytes(), 16u * (72 + 4));
    expect_outward(bvh);
    const auto at_9 =
        static_cast<std::size_t>(std::ranges::find(bvh.order(), 9u) - bvh.order().begin());
    EXPECT_FALSE(std::signbit(bvh.triangles()[at_9].v0.y));
    EXPECT_EQ(bvh.triangles()[at_9].v0.z, 0.0);  // below 2^-500
    EXPECT_EQ(message_of([&] { (void)build_bvh(mesh, {.strict = true}); }),
              "triangle 4: not finite or out of range, as are 3 others");
    mesh.triangles[11][2] = 60;
    EXPECT_EQ(message_of([&] { (void)build_bvh(mesh); }),
              "triangle 11: index 60 is past the last of 60 vertices");
    EXPECT_THROW((void)build_bvh(random_soup_d(3, 1), {.bits = 31}), InputError);
}

TEST(BuildDouble, EmptyMeshes) {
    MeshD mesh;
    EXPECT_TRUE(build_bvh(mesh).empty());
    mesh.vertices.assign(3, Vec3d{nan, 0, 0});
    mesh.triangles = {{0, 1, 2}};
    const BvhD bvh = build_bvh(mesh);
    EXPECT_TRUE(bvh.empty());
    EXPECT_EQ(bvh.left_out(), 1u);
    EXPECT_FALSE(bvh.bounds().lo.x <= bvh.bounds().hi.x);
    EXPECT_EQ(bvh.bytes(), 0u);
}

/// A piece of a triangle's plane, in rational arithmetic.
using ExactPiece = std::vector<ExactPoint>;
Exact coordinate(const ExactPoint& p, std::size_t k) { return k == 0 ? p.x : k == 1 ? p.y : p.z; }
float coordinate(Vec3 p, std::size_t k) { return (&p.x)[k]; }

/// Where sign * (coordinate - plane) <= 0.
ExactPiece clipped(const ExactPiece& piece, std::size_t axis, const Exact& plane, int sign) {
    ExactPiece out;
    for (std::size_t i = 0; i < piece.size(); ++i) {
        const ExactPoint &a = piece[i], &b = piece[(i + 1) % piece.size()];
        const Exact from = sign * (coordinate(a, axis) - plane),
                    to = sign * (coordinate(b, axis) - plane);
        if (from <= 0) out.push_back(a);
        if (from * to >= 0) continue;
        const Exact t = from / (from - to);
        const ExactPoint d = b - a;
        out.push_back({a.x + t * d.x, a.y + t * d.y, a.z + t * d.z});
    }
    return out;
}

/// Cut at faces of boxes until each piece is in one, or in none.
bool covered(const ExactPiece& piece, const std::vector<Aabb>& boxes) {
    Exact lo[3], hi[3];
    for (std::size_t k = 0; k < 3; ++k) {
        lo[k] = hi[k] = coordinate(piece[0], k);
        for (const ExactPoint& p : piece) {
            lo[k] = std::min(lo[k], coordinate(p, k));
            hi[k] = std::max(hi[k], coordinate(p, k));
        }
    }
    for (const Aabb& box : boxes) {
        bool meets = true, holds = true;
        for (std::size_t k = 0; k < 3; ++k) {
            const Exact from(coordinate(box.lo, k)), to(coordinate(box.hi, k));
            meets = meets && lo[k] <= to && hi[k] >= from;
            holds = holds && lo[k] >= from && hi[k] <= to;
        }
        if (holds) return true;
        if (!meets) continue;
        for (std::size_t k = 0; k < 3; ++k)
            for (const float face : {coordinate(box.lo, k), coordinate(box.hi, k)})
                if (const Exact plane(face); lo[k] < plane && plane < hi[k])
                    return covered(clipped(piece, k, plane, 1), boxes) &&
                           covered(clipped(piece, k, plane, -1), boxes);
    }
    return false;
}

/// How many triangles' parts do not hold all of it.
std::size_t count_uncovered(const BvhD& bvh) {
    std::map<std::uint32_t, std::vector<Aabb>> boxes;
    std::map<std::uint32_t, LeafTriangleD> triangles;
    for (const BvhNode& node : bvh.tree().nodes())
        for (std::uint32_t k = node.first; k < node.first + node.count; ++k) {
            boxes[bvh.order()[k]].push_back({node.lo, node.hi});
            triangles[bvh.order()[k]] = bvh.triangles()[k];
        }
    const ExactPoint center = exact(bvh.center());
    const Exact scale(bvh.scale());
    std::size_t uncovered = 0;
    for (const auto& [id, parts] : boxes) {
        if (sanitized && id % 64 != 0) continue;  // exact arithmetic takes its time
        ExactPiece whole;
        for (const Vec3d& p : {triangles[id].v0, triangles[id].v1, triangles[id].v2}) {
            const ExactPoint at = exact(p) - center;
            whole.push_back({at.x * scale, at.y * scale, at.z * scale});
        }
        uncovered += !covered(whole, parts);
    }
    return uncovered;
}

TEST(BuildDouble, PartsCoverTheirTriangles) {
    MeshD nearly_flat = slivers_d(800, 13, {});  // edges that barely cross a plane
    for (Vec3d& p : nearly_flat.vertices) p.z = p.z * 1e-11 + 1.0 / 3;
    for (const MeshD& mesh :
         {slivers_d(800, 12), with_stray(slivers_d(800, 12), utm_place - Vec3d{800.0, 0.0, 0.0}),
          slivers_d(800, 12, {}), nearly_flat,
          in_double(in_float(slivers_d(800, 14, {})), 3e9, {-0.1e12, 0.2e12, 0.1e12})})
        for (const Builder builder : {Builder::split, Builder::sbvh}) {
            const BvhD bvh = build_bvh(mesh, {.builder = builder, .max_leaf = 1});
            EXPECT_EQ(bvh.left_out(), 0u);
            if (builder == Builder::sbvh) {
                EXPECT_GT(bvh.order().size(), mesh.triangles.size());
            }
            EXPECT_EQ(count_uncovered(bvh), 0u)
                << builder_name(builder) << " around " << bvh.center().x;
            const CheckReport report = check(bvh.tree());
            EXPECT_TRUE(report.ok) << report.broken;
        }
}

/// The image of a triangle, without rounding.
ExactPiece image(const LeafTriangleD& t, Vec3d center) {
    return {exact(t.v0) - exact(center), exact(t.v1) - exact(center), exact(t.v2) - exact(center)};
}

/// An edge along the plane of a cut, a few roundings off it: rounded corners lie on the wrong side.
TEST(BuildDouble, CutsHoldWhatRoundingMoved) {
    RandomD random(16);
    const Vec3d center{1.0 / 3, -1.0 / 7, 0.1};
    const float plane = 64.0f;
    MeshD mesh;
    constexpr auto count = static_cast<std::uint32_t>(fewer(2000, 40));
    Buffer<SahReference> references(count), spare;
    for (std::uint32_t i = 0; i < count; ++i) {
        const auto near = [&] {
            const double steps = 0x1p-47 * static_cast<double>(random.below(9));
            return plane + center.x + steps - 0x1p-45;
        };
        mesh.vertices.insert(mesh.vertices.end(),
                             {{near(), random.between(10, 50), random.between(10, 50)},
                              {near(), random.between(60, 99), random.between(60, 99)},
                              {random.between(1, 127), random.between(1, 99), 50.0}});
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
        const auto& v = mesh.vertices;
        references[i] = make_reference(
            box_around_center(box_of(v[3 * i], v[3 * i + 1], v[3 * i + 2]), center, 1.0), i);
    }
    const TriangleCorners corners(mesh, center, 1.0);
    const ReferenceCutter cutter(corners);
    std::vector<std::vector<Aabb>> early(count);
    std::size_t uncovered = 0, uncovered_early = 0, cuts = 0;
    split_early(corners, {{0, 0, 0}, {128, 128, 128}}, {.budget = 9, .least_waste = 1e-3},
                references, spare);
    for (const SahReference& r : references.view()) early[r.primitive_id].push_back(r.box());
    EXPECT_GT(references.size(), 2 * count);
    for (std::uint32_t i = 0; i < count; ++i) {
        const auto* v = &mesh.vertices[3 * std::size_t{i}];
        const ExactPiece whole = image({v[0], v[1], v[2]}, center);
        uncovered_early += !covered(whole, early[i]);
        const Aabb box = box_around_center(box_of(v[0], v[1], v[2]), center, 1.0);
        if (!(box.lo.x < plane && plane < box.hi.x)) continue;
        ++cuts;
        const CutReference parts = cutter.cut(SplitBox::of(box, i, 1), 0, plane);
        uncovered += !covered(whole, {parts.left, parts.right});
    }
    EXPECT_GT(cuts, count / 2);
    EXPECT_EQ(uncovered, 0u);
    EXPECT_EQ(uncovered_early, 0u);
}

TEST(BuildDouble, TreesOfPartsLeaveOutAndRefuseWhatOthersDo) {
    MeshD mesh = slivers_d(6000, 15);
    const MeshD good = mesh;
    mesh.vertices[3 * 4].x = nan;
    mesh.vertices[3 * 32 + 1].y = inf;
    for (const Builder builder : {Builder::split, Builder::sbvh}) {
        BvhD bvh = build_bvh(mesh, {.builder = builder});
        EXPECT_EQ(bvh.left_out(), 2u);
        EXPECT_GT(bvh.order().size(), mesh.triangles.size());
        EXPECT_EQ(bvh.order().size(), bvh.triangles().size());
        EXPECT_EQ(std::ranges::count(bvh.order(), 32u), 0);
        EXPECT_EQ(count_uncovered(bvh), 0u);
        EXPECT_THROW((void)build_bvh(mesh, {.builder = builder, .strict = true}), InputError);
        EXPECT_EQ(message_of([&] { refit(bvh, mesh); }),
                  "refit: this tree of builder " + std::string(builder_name(builder)) +
                      " holds parts of triangles, which are not kept; build it again, or with "
                      "another builder");
        MeshD one{"", {good.vertices[0], good.vertices[1], good.vertices[2]}, {{0, 1, 2}}};
        EXPECT_EQ(build_bvh(one, {.builder = builder}).order().size(), 1u);
    }
}

TEST(BuildDouble, TreesDoNotDependOnThreads) {
    const MeshD mesh = slivers_d(fewer(20'000, 4), 7);
    for (const Builder builder : {Builder::karras, Builder::ploc, Builder::hploc, Builder::binned,
                                  Builder::sweep, Builder::split, Builder::sbvh}) {
        const BvhD one = build_bvh(mesh, {.builder = builder, .threads = 1});
        for (const int threads : {2, 7}) {
            const BvhD more = build_bvh(mesh, {.builder = builder, .threads = threads});
            EXPECT_EQ(tree_hash(one.tree()), tree_hash(more.tree())) << builder_name(builder);
            EXPECT_TRUE(one.center() == more.center());
        }
    }
}

TEST(BuildDouble, RefitsToNewPlaces) {
    const MeshD mesh = in_double(random_soup(500, 8), 100.0, utm_place);
    MeshD moved = in_double(random_soup(500, 9), 50.0, {-7e5, 1e3, 20.0});
    BvhD bvh = build_bvh(mesh, {.builder = Builder::ploc});
    EXPECT_GT(refit(bvh, moved).sah, 0.0);
    expect_outward(bvh);
    const std::vector<RayD> rays = mixed_rays(moved, 500 * thorough, 3);
    EXPECT_EQ(trace(bvh, rays), trace_brute_force(moved, rays));
    const AabbD box = bvh.bounds(), wanted = box_of_mesh(moved);
    EXPECT_TRUE(box.lo == wanted.lo && box.hi == wanted.hi);
    moved.vertices[30].x = nan;
    EXPECT_THROW(refit(bvh, moved), InputError);
    EXPECT_TRUE(bvh.bounds().lo == wanted.lo);  // nothing has changed
    moved.triangles.pop_back();
    EXPECT_THROW(refit(bvh, moved), InputError);
}

TEST(BuildDouble, RefitsNameTheTriangle) {
    const MeshD mesh = in_double(random_soup(500, 8), 100.0, utm_place);
    for (const int threads : {1, 3}) {
        BvhD bvh = build_bvh(mesh);
        const auto message = [&](const MeshD& changed) {
            return message_of([&] { refit(bvh, changed, threads); });
        };
        MeshD changed = mesh;
        changed.vertices[3 * 400].x = nan;
        changed.vertices[3 * 77 + 1].y = 1.1e12;
        changed.vertices[3 * 123 + 2].z = inf;
        EXPECT_EQ(message(changed), "refit: triangle 77 is not finite or out of range now");
        changed = mesh;
        const Vec3d at{0, 0, 0};
        for (std::size_t k = 0; k < 3; ++k) changed.vertices[3 * 9 + k] = at;
        changed.vertices[3 * 9].x = 1e-13;  // smaller than 1e-12, but no point
        EXPECT_EQ(message(changed), "refit: triangle 9 is not finite or out of range now");
        changed.vertices[3 * 9].x = 0.0;
        EXPECT_EQ(message(changed), "no error");
        changed = mesh;
        changed.triangles[30][1] = 1500;
        EXPECT_EQ(message(changed), "triangle 30: index 1500 is past the last of 1500 vertices");
        changed = mesh;
        changed.triangles.resize(400);
        EXPECT_EQ(message(changed), "refit: 400 triangles, but the tree was built from 500");
        // Left out at first, valid now.
        MeshD broken = mesh;
        broken.vertices[3 * 5].x = nan;
        bvh = build_bvh(broken);
        EXPECT_EQ(message(mesh),
                  "refit: 1 triangle(s) were left out when the tree was built, but are valid now");
        EXPECT_EQ(message(broken), "no error");
    }
}

TEST(BuildManyDouble, AreTheTreesOfEachMesh) {
    std::vector<MeshD> meshes;
    for (std::size_t i = 0; i < 150; ++i) {
        const Vec3d place = static_cast<double>(i % 3) * utm_place;
        meshes.push_back(
            in_double(random_soup(i % 40, 20 + i), 1.0 + static_cast<double>(i), place));
    }
    meshes[60].vertices[0].x = nan;
    const std::vector<MeshViewD> views(meshes.begin(), meshes.end());
    for (const int threads : {1, 2, 7})
        for (const Builder builder : {Builder::apetrei, Builder::ploc, Builder::sbvh}) {
            const std::vector<BvhD> trees =
                build_many(views, {.builder = builder, .threads = threads});
            ASSERT_EQ(trees.size(), meshes.size());
            for (std::size_t i = 0; i < trees.size(); ++i) {
                const BvhD one = build_bvh(meshes[i], {.builder = builder});
                EXPECT_EQ(tree_hash(trees[i].tree()), tree_hash(one.tree()));
                EXPECT_EQ(trees[i].center(), one.center());
                EXPECT_EQ(trees[i].scale(), one.scale());
                EXPECT_EQ(trees[i].left_out(), one.left_out());
                EXPECT_EQ(trees[i].bounds().hi, one.bounds().hi);
                EXPECT_EQ(trees[i].tree().peak_bytes(), 0u);
                ASSERT_EQ(trees[i].triangles().size(), one.triangles().size());
                for (std::size_t k = 0; k < one.triangles().size(); ++k)
                    EXPECT_EQ(trees[i].triangles()[k].v2, one.triangles()[k].v2);
            }
        }
    meshes[123].triangles[0][0] = 100000;
    const std::vector<MeshViewD> broken(meshes.begin(), meshes.end());
    const auto message = [&](const BuildOptions& options) {
        return message_of([&] { static_cast<void>(build_many(broken, options)); }).substr(0, 23);
    };
    EXPECT_EQ(message({}), "mesh 123: triangle 0: i");
    EXPECT_EQ(message({.strict = true, .threads = 1}), "mesh 60: triangle 0: no");
    EXPECT_TRUE(build_many(std::span<const MeshViewD>{}).empty());
}

TEST(BuildDouble, ATreeThatWasNeverBuiltHasEmptyBounds) {
    const BvhD never, nothing = build_bvh(MeshD{});
    EXPECT_GT(never.bounds().lo.x, never.bounds().hi.x);
    EXPECT_GT(nothing.bounds().lo.z, nothing.bounds().hi.z);
}

}  // namespace
}  // namespace raydix::test
