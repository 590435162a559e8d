// Numbers that no caller can have meant, in every public call that takes them: threads below 0 or
// above 1,024, and enumerations cast from anything.
#include <gtest/gtest.h>
#include <raydix/cwbvh.h>
#include <raydix/device.h>
#include <raydix/device_cwbvh.h>
#include <raydix/device_trees.h>
#include <raydix/double.h>
#include <raydix/hierarchy_study.h>
#include <raydix/kdtree.h>
#include <raydix/octree.h>
#include <raydix/raydix.h>
#include <raydix/simulate.h>
#include <raydix/tree_view.h>
#include <raydix/wide.h>

#include <climits>
#include <functional>
#include <string>
#include <vector>

#include "support/message.h"
#include "support/support.h"

namespace raydix {
namespace {

using test::message_of;

/// A call with an option left open, under its name.
template <class Value>
struct Call {
    const char* name;
    std::function<void(Value)> run;
};

/// Everything that calls need, for a mesh with triangles in it or with none.
struct Inputs {
    Mesh mesh;
    MeshD mesh_d;
    std::vector<Aabb> boxes;
    std::vector<Ray> rays;
    std::vector<RayD> rays_d;
    std::vector<Vec3> points;
    std::vector<Vec3d> points_d;
    Bvh bvh, box_bvh;
    BvhD bvh_d;
    WideBvh wide;
    WarpTree warp;
    KdTree kd, kd_points;
    Octree octree;
    Points index;
    PointsD index_d;
    Solid solid;
    SolidD solid_d;
    Scene scene;
    SceneD scene_d;

    /// `count` triangles, boxes, points, rays and queries each.
    explicit Inputs(std::size_t count)
        : mesh(test::random_soup(count, 1)),
          mesh_d(wide_mesh(mesh)),
          boxes(count, Aabb{{0, 0, 0}, {1, 1, 1}}),
          rays(count, Ray{{0.5f, 0.5f, -1}, 0, {0, 0, 1}}),
          rays_d(count, RayD{{0.5, 0.5, -1}, 0, {0, 0, 1}}),
          points(count, Vec3{0.5f, 0.5f, 0.5f}),
          points_d(count, Vec3d{0.5, 0.5, 0.5}),
          bvh(build_bvh(mesh)),
          box_bvh(build_bvh(boxes)),
          bvh_d(build_bvh(mesh_d)),
          wide(bvh),
          warp(bvh),
          kd(build_kdtree(mesh)),
          kd_points(build_kdtree(points)),
          octree(build_octree(points)),
          index(build_points(std::span<const Vec3>(points))),
          index_d(build_points(std::span<const Vec3d>(points_d))),
          solid(bvh),
          solid_d(bvh_d),
          scene(mesh),
          scene_d(mesh_d) {}

    static MeshD wide_mesh(const Mesh& mesh) {
        MeshD wide;
        for (const Vec3 p : mesh.vertices) wide.vertices.push_back({p.x, p.y, p.z});
        wide.triangles = mesh.triangles;
        return wide;
    }
};

Camera camera() {
    Camera camera;
    camera.position = {0, 0, -5};
    camera.target = {0, 0, 0};
    camera.up = {0, 1, 0};
    return camera;
}

RenderOptions small_picture(View view, int threads) {
    RenderOptions options;
    options.view = view;
    options.width = options.height = 2;
    options.threads = threads;
    return options;
}

using Threads = Call<int>;

std::vector<Threads> builds(Inputs& in) {
    return {
        {"build_bvh", [&in](int n) { (void)build_bvh(in.mesh, {.threads = n}); }},
        {"build_bvh boxes", [&in](int n) { (void)build_bvh(in.boxes, {.threads = n}); }},
        {"build_bvh points",
         [&in](int n) { (void)build_bvh(std::span<const Vec3>(in.points), {.threads = n}); }},
        {"build_bvh double", [&in](int n) { (void)build_bvh(in.mesh_d, {.threads = n}); }},
        {"build_many",
         [&in](int n) {
             const MeshView view = in.mesh;
             (void)build_many(std::span(&view, 1), {.threads = n});
         }},
        {"build_many of none",
         [](int n) { (void)build_many(std::span<const MeshView>(), {.threads = n}); }},
        {"build_many double",
         [](int n) { (void)build_many(std::span<const MeshViewD>(), {.threads = n}); }},
        {"build_wide_bvh",
         [&in](int n) { (void)build_wide_bvh(in.mesh, {.builder = Builder::ploc, .threads = n}); }},
        {"WideBvh", [&in](int n) { (void)WideBvh(in.bvh, {.threads = n}); }},
        {"Cwbvh", [&in](int n) { (void)Cwbvh(in.bvh, n); }},
        {"build_kdtree", [&in](int n) { (void)build_kdtree(in.mesh, {.threads = n}); }},
        {"build_octree", [&in](int n) { (void)build_octree(in.mesh, {.threads = n}); }},
        {"build_points",
         [&in](int n) { (void)build_points(std::span<const Vec3>(in.points), {.threads = n}); }},
        {"refit", [&in](int n) { (void)refit(in.bvh, in.mesh, n); }},
        {"refit boxes", [&in](int n) { (void)refit(in.box_bvh, in.boxes, n); }},
        {"refit double", [&in](int n) { (void)refit(in.bvh_d, in.mesh_d, n); }},
        {"Solid", [&in](int n) { (void)Solid(in.bvh, {.threads = n}); }},
        {"SolidD", [&in](int n) { (void)SolidD(in.bvh_d, {.threads = n}); }},
        {"Scene", [&in](int n) { (void)Scene(in.mesh, {.threads = n}); }},
        {"SceneD", [&in](int n) { (void)SceneD(in.mesh_d, {.threads = n}); }},
        {"tree_stats", [&in](int n) { (void)tree_stats(in.bvh, {.threads = n}); }},
        {"study_hierarchy",
         [&in](int n) { (void)study_hierarchy(in.mesh, {.threads = n, .repeat = 1}); }},
        {"device_node_capacity", [](int n) { (void)device_node_capacity(5u, {.threads = n}); }},
    };
}

std::vector<Threads> traces(Inputs& in) {
    const auto hits = [&in] { return std::vector<Hit>(in.rays.size()); };
    const auto flags = [&in] { return std::vector<std::uint8_t>(in.rays.size()); };
    return {
        {"trace", [&in](int n) { (void)trace(in.bvh, in.rays, {.threads = n}); }},
        {"trace_any",
         [&in, flags](int n) {
             auto to = flags();
             trace_any(in.bvh, in.rays, to, {.threads = n});
         }},
        {"trace_all", [&in](int n) { (void)trace_all(in.bvh, in.rays, {.threads = n}); }},
        {"trace_brute_force", [&in](int n) { (void)trace_brute_force(in.mesh, in.rays, n); }},
        {"trace double", [&in](int n) { (void)trace(in.bvh_d, in.rays_d, {.threads = n}); }},
        {"trace_any double",
         [&in, flags](int n) {
             auto to = flags();
             trace_any(in.bvh_d, in.rays_d, to, {.threads = n});
         }},
        {"trace_all double",
         [&in](int n) { (void)trace_all(in.bvh_d, in.rays_d, {.threads = n}); }},
        {"trace_brute_force double",
         [&in](int n) { (void)trace_brute_force(in.mesh_d, in.rays_d, n); }},
        {"trace wide", [&in](int n) { (void)trace(in.wide, in.rays, {.threads = n}); }},
        {"trace_any wide",
         [&in, flags](int n) {
             auto to = flags();
             trace_any(in.wide, in.rays, to, {.threads = n});
         }},
        {"trace_all wide", [&in](int n) { (void)trace_all(in.wide, in.rays, {.threads = n}); }},
        {"kd_trace", [&in](int n) { (void)kd_trace(in.kd, in.rays, {.threads = n}); }},
        {"kd_trace_any",
         [&in, flags](int n) {
             auto to = flags();
             kd_trace_any(in.kd, in.rays, to, {.threads = n});
         }},
        {"trace_reference",
         [&in](int n) {
             std::vector<TreeHit> to(in.rays.size());
             trace_reference(in.warp, in.rays, to, false, n);
         }},
        {"simulate", [&in](int n) { (void)simulate(in.warp, in.rays, {}, nullptr, n); }},
        {"make_secondary_rays",
         [&in, hits](int n) {
             (void)make_secondary_rays(in.bvh, in.rays, hits(),
                                       std::vector<std::uint32_t>(in.rays.size()), {.threads = n});
         }},
        {"render",
         [&in](int n) { (void)render(in.bvh, camera(), small_picture(View::shaded, n)); }},
        {"render_tree",
         [&in](int n) { (void)render_tree(in.bvh, camera(), {}, small_picture(View::shaded, n)); }},
        {"trace scene", [&in](int n) { (void)trace(in.scene, in.rays, {.threads = n}); }},
        {"trace scene double",
         [&in](int n) { (void)trace(in.scene_d, in.rays_d, {.threads = n}); }},
        {"trace_all scene", [&in](int n) { (void)trace_all(in.scene, in.rays, {.threads = n}); }},
    };
}

std::vector<Threads> queries(Inputs& in) {
    const auto flags = [&in] { return std::vector<std::uint8_t>(in.points.size()); };
    const auto segments = [&in] { return std::vector<Segment>(in.points.size()); };
    const auto sweeps = [&in] { return std::vector<SphereSweep>(in.points.size()); };
    const std::span<const Vec3> points = in.points;
    const std::span<const Vec3d> points_d = in.points_d;
    return {
        {"closest_points",
         [&in](int n) { (void)closest_points(in.bvh, in.points, {.threads = n}); }},
        {"closest_points double",
         [&in](int n) { (void)closest_points(in.bvh_d, in.points_d, {.threads = n}); }},
        {"contains",
         [&in, flags](int n) {
             auto to = flags();
             contains(in.solid, in.points, to, n);
         }},
        {"contains double",
         [&in, flags](int n) {
             auto to = flags();
             contains(in.solid_d, in.points_d, to, n);
         }},
        {"signed_distances",
         [&in](int n) { (void)signed_distances(in.solid, in.points, {.threads = n}); }},
        {"signed_distances double",
         [&in](int n) { (void)signed_distances(in.solid_d, in.points_d, {.threads = n}); }},
        {"winding_numbers", [&in](int n) { (void)winding_numbers(in.solid, in.points, n); }},
        {"winding_numbers double",
         [&in](int n) { (void)winding_numbers(in.solid_d, in.points_d, n); }},
        {"touch_any",
         [&in, flags, segments](int n) {
             auto to = flags();
             touch_any(in.bvh, segments(), to, {.threads = n});
         }},
        {"touch_all",
         [&in, segments](int n) { (void)touch_all(in.bvh, segments(), {.threads = n}); }},
        {"sweep_spheres",
         [&in, sweeps](int n) { (void)sweep_spheres(in.bvh, sweeps(), {.threads = n}); }},
        {"overlapping_pairs", [&in](int n) { (void)overlapping_pairs(in.bvh, {.threads = n}); }},
        {"overlapping_pairs double",
         [&in](int n) { (void)overlapping_pairs(in.bvh_d, {.threads = n}); }},
        {"count_overlapping_pairs",
         [&in](int n) { (void)count_overlapping_pairs(in.bvh, in.box_bvh, {.threads = n}); }},
        {"kd_nearest",
         [&in](int n) { (void)kd_nearest(in.kd_points, in.points, 2, {.threads = n}); }},
        {"locate", [&in](int n) { (void)locate(in.octree, in.points, n); }},
        {"neighbour",
         [&in](int n) {
             (void)neighbour(in.octree, std::span<const std::uint32_t>(), Direction{1, 0, 0}, n);
         }},
        {"points_in_boxes", [&in](int n) { (void)points_in_boxes(in.octree, in.boxes, n); }},
        {"knn", [&in, points](int n) { (void)knn(in.index, points, 2, {.threads = n}); }},
        {"knn double",
         [&in, points_d](int n) { (void)knn(in.index_d, points_d, 2, {.threads = n}); }},
        {"radius_search",
         [&in, points](int n) { (void)radius_search(in.index, points, 1.0f, {.threads = n}); }},
        {"radius_count",
         [&in, points](int n) {
             std::vector<std::uint32_t> to(points.size());
             radius_count(in.index, points, 1.0f, to, {.threads = n});
         }},
        {"box_search",
         [&in](int n) {
             (void)box_search(in.index, std::span<const Aabb>(in.boxes), {.threads = n});
         }},
        {"neighbour_lists",
         [&in](int n) { (void)neighbour_lists(in.index, 1.0f, PairRows::half, {.threads = n}); }},
    };
}

TEST(Options, ThreadsAre0To1024InEveryCall) {
    for (const std::size_t count : {0u, 3u}) {
        Inputs in(count);
        std::size_t calls = 0;
        for (const auto& list : {builds(in), traces(in), queries(in)})
            for (const Threads& call : list) {
                ++calls;
                for (const int threads : {-1, 1025, 100000, INT_MAX, INT_MIN})
                    EXPECT_NE(message_of([&] { call.run(threads); })
                                  .find("option threads is " + std::to_string(threads) +
                                        "; it must be 0 to 1024"),
                              std::string::npos)
                        << call.name << " over " << count << ", threads " << threads;
                EXPECT_EQ(message_of([&] { call.run(1); }), "no error") << call.name;
            }
        EXPECT_GT(calls, 65u);
    }
}

template <class Enum>
void expect_refused(const std::string& option, int last, const std::function<void(Enum)>& call) {
    for (const int number : {last + 1, 99, 0x7FFFFFFF})
        EXPECT_EQ(message_of([&] { call(static_cast<Enum>(number)); }),
                  "option " + option + " is " + std::to_string(number) + "; it must be 0 to " +
                      std::to_string(last));
}

TEST(Options, EnumerationsAreOfTheirKind) {
    for (const std::size_t count : {0u, 3u}) {
        Inputs in(count);
        const std::span<const Vec3> points = in.points;
        expect_refused<Builder>("builder", 9,
                                [&](Builder b) { (void)build_bvh(in.mesh, {.builder = b}); });
        expect_refused<Builder>("builder", 9,
                                [&](Builder b) { (void)build_bvh(in.mesh_d, {.builder = b}); });
        expect_refused<Builder>("builder", 9,
                                [&](Builder b) { (void)build_wide_bvh(in.mesh, {.builder = b}); });
        expect_refused<Builder>("builder", 9,
                                [&](Builder b) { (void)device_node_capacity(5u, {.builder = b}); });
        const auto study = [&](const StudyCase& what) {
            (void)study_hierarchy(in.mesh, {.repeat = 1, .cases = {what}});
        };
        expect_refused<StudyForm>("form", 2, [&](StudyForm f) { study({"codes", f}); });
        expect_refused<Fit>("fit", 2, [&](Fit f) { study({"karras", StudyForm::launches, f}); });
        expect_refused<Fit>("fit", 2, [&](Fit f) { (void)build_bvh(in.boxes, {.fit = f}); });
        expect_refused<SimdPath>("path", 4,
                                 [&](SimdPath p) { (void)trace(in.bvh, in.rays, {.path = p}); });
        expect_refused<SimdPath>(
            "path", 4, [&](SimdPath p) { (void)trace(in.bvh_d, in.rays_d, {.path = p}); });
        expect_refused<SimdPath>("path", 4,
                                 [&](SimdPath p) { (void)trace(in.wide, in.rays, {.path = p}); });
        expect_refused<SimdPath>(
            "path", 4, [&](SimdPath p) { (void)trace_all(in.wide, in.rays, {.path = p}); });
        expect_refused<SimdPath>("path", 4,
                                 [&](SimdPath p) { (void)kd_trace(in.kd, in.rays, {.path = p}); });
        expect_refused<InsideRule>("rule", 3, [&](InsideRule r) { (void)Solid(in.bvh, {r}); });
        expect_refused<InsideRule>("rule", 3, [&](InsideRule r) { (void)SolidD(in.bvh_d, {r}); });
        expect_refused<PointsTree>("tree", 2,
                                   [&](PointsTree t) { (void)build_points(points, {.tree = t}); });
        expect_refused<QueryOrder>(
            "order", 2, [&](QueryOrder o) { (void)knn(in.index, points, 2, {.order = o}); });
        expect_refused<QueryOrder>("order", 2, [&](QueryOrder o) {
            (void)radius_search(in.index, points, 1.0f, {.order = o});
        });
        expect_refused<PairRows>("rows", 1,
                                 [&](PairRows r) { (void)neighbour_lists(in.index, 1.0f, r); });
        expect_refused<WarpKernel>("kernel", 14, [&](WarpKernel k) {
            const SimulateOptions run{.kernel = k,
                                      .machine = machine_model(machine_model_names().front())};
            (void)simulate(in.warp, in.rays, std::span(&run, 1));
        });
        expect_refused<CwbvhKernel>("kernel", 1,
                                    [&](CwbvhKernel k) { (void)device_cwbvh_scratch_bytes(k); });
        expect_refused<View>("view", 7,
                             [&](View v) { (void)render(in.bvh, camera(), small_picture(v, 1)); });
        expect_refused<RayKind>("kind", 3, [&](RayKind k) {
            (void)make_secondary_rays(in.bvh, in.rays, std::vector<Hit>(in.rays.size()),
                                      std::vector<std::uint32_t>(in.rays.size()), {.kind = k});
        });
    }
    expect_refused<Quality>("quality", 2, [](Quality q) { (void)build_options_for(q); });
    EXPECT_EQ(message_of([] { (void)build_options_for(static_cast<Quality>(-1)); }),
              "option quality is -1; it must be 0 to 2");
    EXPECT_EQ(simd_path_name(static_cast<SimdPath>(99)), "unknown");
    EXPECT_EQ(warp_kernel_name(static_cast<WarpKernel>(99)), "unknown");
    EXPECT_EQ(points_tree_name(static_cast<PointsTree>(99)), "unknown");
    EXPECT_EQ(builder_name(static_cast<Builder>(99)), "unknown");
    EXPECT_EQ(view_name(static_cast<View>(99)), "unknown");
    EXPECT_EQ(ray_kind_name(static_cast<RayKind>(99)), "unknown");
}

}  // namespace
}  // namespace raydix
