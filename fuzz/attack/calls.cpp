// Arguments that make no sense: one clear error, whatever else is given. And empty trees, which may
// be asked everything.
#include <raydix/closest.h>
#include <raydix/cwbvh.h>
#include <raydix/double.h>
#include <raydix/error.h>
#include <raydix/kdtree.h>
#include <raydix/octree.h>
#include <raydix/overlap.h>
#include <raydix/pairs.h>
#include <raydix/points.h>
#include <raydix/refit.h>
#include <raydix/solid.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include <functional>
#include <limits>
#include <new>

#include "attack/attack.h"
#include "attack/ray_families.h"

namespace raydix::attack {
namespace {

/// `call` must be refused by an InputError of one line.
void expect_refusal(Case& c, const char* what, const std::function<void()>& call) {
    std::string outcome = "nothing was thrown";
    try {
        call();
    } catch (const InputError& error) {
        outcome = error.what();
        if (!outcome.empty() && outcome.find('\n') == std::string::npos) {
            c.compared("calls/refused", 1);
            return;
        }
    } catch (const std::exception& error) {
        outcome = error.what();
    }
    c.expect(false, "calls/refused", text("not refused: %s", what),
             [&] { return "    " + outcome + "\n"; });
}

/// A value far outside of [lo, hi].
int outside(Random& random, int lo, int hi) {
    const int wrong[] = {lo - 1, hi + 1, std::numeric_limits<int>::min(),
                         std::numeric_limits<int>::max()};
    return random.one_of(wrong);
}

void wrong_build_options(Case& c, const Mesh& mesh) {
    Random& random = c.random;
    const auto refused = [&](const char* what, const std::function<void(BuildOptions&)>& spoil) {
        BuildOptions options = any_build_options(random);
        spoil(options);
        expect_refusal(c, what, [&] { (void)build_bvh(mesh, options); });
        expect_refusal(c, what, [&] { (void)build_wide_bvh(mesh, options); });
    };
    refused("builder", [&](BuildOptions& o) { o.builder = Builder(10 + random.below(1000)); });
    refused("bits", [&](BuildOptions& o) { o.bits = 31 + random.whole(0, 20); });
    refused("max_leaf", [&](BuildOptions& o) { o.max_leaf = outside(random, 1, 255); });
    refused("fit", [&](BuildOptions& o) { o.fit = Fit(3 + random.below(1000)); });
    // At most a few thousand: a call that does not refuse starts them.
    refused("threads", [&](BuildOptions& o) { o.threads = random.chance(0.5) ? -1 : 1025; });
    refused("reinsertion_rounds",
            [&](BuildOptions& o) { o.reinsertion_rounds = outside(random, 0, 255); });
    Mesh torn = mesh;
    if (!torn.triangles.empty()) {
        torn.triangles[random.below(torn.triangles.size())][random.below(3)] =
            static_cast<std::uint32_t>(torn.vertices.size()) + random.below(3);
        expect_refusal(c, "index past the vertices", [&] { (void)build_bvh(torn); });
        expect_refusal(c, "index past the vertices", [&] { (void)build_kdtree(torn); });
        expect_refusal(c, "index past the vertices", [&] { (void)build_octree(torn); });
        expect_refusal(c, "index past the vertices",
                       [&] { (void)trace_brute_force(torn, std::vector<Ray>(1), 1); });
    }
}

void wrong_queries(Case& c, const Mesh& mesh) {
    const Bvh tree = build_bvh(mesh, any_build_options(c.random));
    const WideBvh wide(tree);
    const std::vector<Ray> rays = make_rays(c.random, mesh, 3);
    std::vector<Hit> hits(2);
    std::vector<std::uint8_t> bytes(2);
    const std::vector<Vec3> points(3, Vec3{0, 0, 0});
    const auto refused = [&](const char* what, const std::function<void()>& call) {
        expect_refusal(c, what, call);
    };
    refused("sizes of trace", [&] { trace(tree, rays, hits); });
    refused("sizes of trace_any", [&] { trace_any(tree, rays, bytes); });
    refused("sizes of wide trace", [&] { trace(wide, rays, hits); });
    refused("sizes of wide trace_any", [&] { trace_any(wide, rays, bytes); });
    refused("isa", [&] { (void)trace(wide, rays, {.isa = "abacus"}); });
    refused("path", [&] { (void)trace(wide, rays, {.path = SimdPath(77)}); });
    refused("threads of trace", [&] { (void)trace(tree, rays, {.threads = -5}); });
    refused("threads of trace", [&] { (void)trace(tree, rays, {.threads = 1025}); });
    refused("width", [&] { (void)WideBvh(tree, {.width = 5}); });
    refused("max_distance", [&] { (void)closest_points(tree, points, {.max_distance = -1}); });
    refused("max_distance", [&] {
        (void)closest_points(tree, points,
                             {.max_distance = std::numeric_limits<float>::quiet_NaN()});
    });
    refused("bits of a k-d tree", [&] { (void)build_kdtree(mesh, {.bits = 7}); });
    refused("max_leaf of a k-d tree", [&] { (void)build_kdtree(mesh, {.max_leaf = 256}); });
    refused("max_level of an octree", [&] { (void)build_octree(mesh, {.max_level = 22}); });
    refused("a node that is not there", [&] { (void)node_box(build_octree(mesh), 0xFFFFFFF0u); });
    const Points index = build_points(points);
    refused("k of 0", [&] { (void)knn(index, points, 0); });
    refused("a negative radius", [&] { (void)radius_search(index, points, -1.0f); });
    refused("tree of points", [&] { (void)build_points(points, {.tree = PointsTree(9)}); });
    refused("order of queries", [&] { (void)knn(index, points, 1, {.order = QueryOrder(9)}); });
    refused("instructions of points", [&] { (void)knn(index, points, 1, {.isa = "abacus"}); });
    refused("inside rule", [&] { (void)Solid(tree, {.rule = InsideRule(9)}); });
    const Bvh of_points = build_bvh(std::span<const Vec3>(points));
    refused("rays through points", [&] { (void)trace(of_points, rays); });
    refused("closest point of points", [&] { (void)closest_points(of_points, points); });
    refused("wide tree of points", [&] { (void)WideBvh(of_points); });
    refused("narrow pairs of points",
            [&] { (void)overlapping_pairs(of_points, {.narrow = true}); });
    refused("solid of points", [&] { (void)Solid(of_points); });
}

void empty_trees(Case& c) {
    const Mesh nothing;
    const Bvh tree = build_bvh(nothing, any_build_options(c.random));
    const std::vector<Ray> rays(3, Ray{{0, 0, 0}, 0, {1, 0, 0}, infinity});
    const std::vector<Vec3> points(3, Vec3{1, 2, 3});
    bool hit = false;
    const auto none = [&](const auto& hits) {
        for (const auto& one : hits) hit = hit || one.prim != no_primitive;
    };
    none(trace(tree, rays));
    none(trace(WideBvh(), rays));
    none(trace(WideBvh(tree), rays));
    hit = hit || !Cwbvh(tree).empty();
    none(trace(BvhD(), std::vector<RayD>(2)));
    none(kd_trace(build_kdtree(nothing), rays));
    none(trace_all(tree, rays).hits);
    none(closest_points(tree, points));
    none(sweep_spheres(tree, std::vector<SphereSweep>{{rays[0], 1}}));
    none(closest_points(BvhD(), std::vector<Vec3d>(2)));
    c.expect(!hit && overlapping_pairs(tree).empty() && !contains(Solid(tree), points[0]) &&
                 tree_stats(tree).nodes == 0 && !tree_hash(tree).empty() &&
                 knn(Points(), points, 2).indices[0] == no_primitive &&
                 points_in_box(build_octree(nothing), {{0, 0, 0}, {9, 9, 9}}).empty(),
             "calls/empty", "an empty tree finds something");
}

}  // namespace

static void attack_calls(Case& c) {
    TestMesh made = any_mesh(c.random, 20);
    switch (c.random.below(3)) {
        case 0:
            return wrong_build_options(c, made.mesh);
        case 1:
            return wrong_queries(c, made.mesh);
        default:
            return empty_trees(c);
    }
}

static const Kind calls_kind("calls", attack_calls, 0.2);

}  // namespace raydix::attack
