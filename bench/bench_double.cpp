// What does double cost? Builds, closest hits, closest points and moving spheres of one scene in
// float and in double: CPU milliseconds of both (other programs disturb them little),
// their ratio, and work per ray, as it is and with detail below what float nodes can tell apart.
// Hits in double are compared with every triangle first, on a sample. A JSON line per scene, place
// and kind of work on standard output.
#include <fmt/format.h>
#include <raydix/closest.h>
#include <raydix/double.h>
#include <raydix/machine.h>
#include <raydix/model.h>
#include <raydix/overlap.h>
#include <raydix/rays.h>
#include <raydix/trace.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <ctime>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <type_traits>

namespace {

using Json = nlohmann::ordered_json;
using raydix::Vec3;
using raydix::Vec3d;

struct Options {
    std::vector<std::string> scenes{"builtin:atrium?triangles=300000"};
    std::string builder = "ploc";
    std::uint32_t width = 640, height = 480;
    int samples = 2, repeat = 5, threads = 1;
    std::uint64_t seed = 1;
    double outlier = 0.0;
};

Vec3d widened(Vec3 p) { return {p.x, p.y, p.z}; }

double ms_of(int repeat, const auto& work) {
    std::vector<double> ms;
    for (int i = 0; i < repeat; ++i) {
        const std::clock_t start = std::clock();
        work();
        ms.push_back(1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    }
    std::ranges::sort(ms);
    return ms[ms.size() / 2];
}

/// The scene in both, and trees over it.
struct Trees {
    const raydix::Mesh& mesh;
    raydix::MeshD wide;
    raydix::BuildOptions build;
    raydix::Bvh in_float;
    raydix::BvhD in_double;

    Trees(const raydix::Model& scene, const Options& options)
        : mesh(scene.mesh()),
          wide{"", {}, scene.mesh().triangles},
          build{.builder = raydix::builder_from_name(options.builder), .threads = options.threads},
          in_float(build_bvh(mesh, build)) {
        for (const Vec3& v : mesh.vertices) wide.vertices.push_back(widened(v));
        if (options.outlier > 0.0) {  // moves the center away from everything else
            const auto first = static_cast<std::uint32_t>(wide.vertices.size());
            const double at = options.outlier;
            wide.vertices.insert(wide.vertices.end(), {{at, at, at}, {at, at, 0}, {at, 0, at}});
            wide.triangles.push_back({first, first + 1, first + 2});
        }
        in_double = build_bvh(wide, build);
    }
};

void expect_like_every_triangle(const Trees& trees, std::span<const raydix::RayD> rays) {
    std::vector<raydix::RayD> some;
    for (std::size_t i = 0; i < rays.size(); i += rays.size() / 50 + 1) some.push_back(rays[i]);
    if (trace(trees.in_double, some) != trace_brute_force(trees.wide, some))
        throw std::runtime_error("double rays differ from those against every triangle");
}

Json times(double in_float, double in_double) {
    return {{"float_ms", in_float}, {"double_ms", in_double}, {"ratio", in_double / in_float}};
}

Json bench_rays(const Trees& trees, std::span<const raydix::Ray> rays, const Options& options) {
    std::vector<raydix::RayD> wide;
    for (const raydix::Ray& ray : rays)
        wide.push_back({widened(ray.origin), ray.tmin, widened(ray.direction), ray.tmax});
    expect_like_every_triangle(trees, wide);
    std::vector<raydix::Hit> hits(rays.size());
    std::vector<raydix::HitD> wide_hits(rays.size());
    const raydix::TraceOptions counted{.threads = options.threads, .counters = true},
        timed{.threads = options.threads};
    const auto work = trace(trees.in_float, rays, hits, counted);
    const auto wide_work = trace(trees.in_double, wide, wide_hits, counted);
    std::size_t same = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) same += hits[i].prim == wide_hits[i].prim;
    Json line =
        times(ms_of(options.repeat, [&] { trace(trees.in_float, rays, hits, timed); }),
              ms_of(options.repeat, [&] { trace(trees.in_double, wide, wide_hits, timed); }));
    const auto per_ray = [&](std::uint64_t n) {
        return static_cast<double>(n) / static_cast<double>(rays.size());
    };
    line["rays"] = rays.size();
    line["same_primitive"] = per_ray(same);
    line["node_visits_per_ray"] = {per_ray(work.node_visits), per_ray(wide_work.node_visits)};
    line["triangle_tests_per_ray"] = {per_ray(work.triangle_tests),
                                      per_ray(wide_work.triangle_tests)};
    return line;
}

Json bench_closest(const Trees& trees, std::span<const raydix::Ray> rays, const Options& options) {
    std::vector<Vec3> places;
    std::vector<Vec3d> wide;
    for (const raydix::Ray& ray : rays) {
        places.push_back(ray.origin);
        wide.push_back(widened(ray.origin));
    }
    std::vector<raydix::ClosestPoint> points(places.size());
    std::vector<raydix::ClosestPointD> wide_points(places.size());
    return times(
        ms_of(
            options.repeat,
            [&] { closest_points(trees.in_float, places, points, {.threads = options.threads}); }),
        ms_of(options.repeat, [&] {
            closest_points(trees.in_double, wide, wide_points, {.threads = options.threads});
        }));
}

/// Balls along the rays, as large as a part of the scene.
Json bench_sweeps(const Trees& trees, std::span<const raydix::Ray> rays, const Options& options) {
    const raydix::Aabb box = trees.in_float.bounds();
    const float radius = 0.002f * (box.hi.x - box.lo.x);
    std::vector<raydix::SphereSweep> sweeps;
    std::vector<raydix::SphereSweepD> wide;
    for (const raydix::Ray& ray : rays) {
        sweeps.push_back({ray, radius});
        wide.push_back({{widened(ray.origin), ray.tmin, widened(ray.direction), ray.tmax}, radius});
    }
    std::vector<raydix::SweepHit> hits(sweeps.size());
    std::vector<raydix::SweepHitD> wide_hits(sweeps.size());
    const raydix::OverlapOptions timed{.threads = options.threads};
    Json line = times(
        ms_of(options.repeat, [&] { sweep_spheres(trees.in_float, sweeps, hits, timed); }),
        ms_of(options.repeat, [&] { sweep_spheres(trees.in_double, wide, wide_hits, timed); }));
    std::size_t same = 0;
    for (std::size_t i = 0; i < hits.size(); ++i) same += hits[i].prim == wide_hits[i].prim;
    line["sweeps"] = sweeps.size();
    line["same_primitive"] = static_cast<double>(same) / static_cast<double>(sweeps.size());
    return line;
}

void run(const Options& options) {
    for (const std::string& name : options.scenes) {
        const raydix::Model scene = raydix::load_flat_model(name, options.seed);
        const Trees trees(scene, options);
        std::vector<std::uint32_t> pixels;
        const auto primary =
            make_primary_rays(scene.cameras.cameras.at(0), options.width, options.height, &pixels);
        const auto diffuse = make_secondary_rays(
            trees.in_float, primary, trace(trees.in_float, primary), pixels,
            {.kind = raydix::RayKind::diffuse, .samples = options.samples, .seed = options.seed});
        Json line{{"bench", "double"},
                  {"cpu", raydix::machine_info().cpu},
                  {"threads", options.threads},
                  {"compiler", __VERSION__},
                  {"scene", name},
                  {"seed", options.seed},
                  {"triangles", trees.wide.triangles.size()},
                  {"builder", options.builder},
                  {"outlier", options.outlier},
                  {"repeat", options.repeat}};
        line["bytes"] = {trees.in_float.bytes(), trees.in_double.bytes()};
        line["build"] = times(
            ms_of(options.repeat, [&] { static_cast<void>(build_bvh(trees.mesh, trees.build)); }),
            ms_of(options.repeat, [&] { static_cast<void>(build_bvh(trees.wide, trees.build)); }));
        line["primary"] = bench_rays(trees, primary, options);
        line["diffuse"] = bench_rays(trees, diffuse, options);
        line["closest_points"] = bench_closest(trees, diffuse, options);
        line["sweeps"] = bench_sweeps(trees, diffuse, options);
        fmt::print("{}\n", line.dump());
    }
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Builds, rays, closest points and moving spheres in double beside float");
    Options options;
    app.add_option("--scene", options.scenes, "Scenes of triangles")->capture_default_str();
    app.add_option("--builder", options.builder, "Builder")->capture_default_str();
    app.add_option("--width", options.width, "Pixels of a picture")->capture_default_str();
    app.add_option("--height", options.height, "Pixels of a picture")->capture_default_str();
    app.add_option("--samples", options.samples, "Diffuse rays from each primary hit")
        ->capture_default_str();
    app.add_option("--repeat", options.repeat, "Timed runs; the median counts")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    app.add_option("--threads", options.threads, "Threads")->capture_default_str();
    app.add_option("--seed", options.seed, "Seed of built-in scenes")->capture_default_str();
    app.add_option("--outlier", options.outlier, "Add a triangle this far away, in double only")
        ->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try {
        run(options);
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench_double: {}\n", error.what());
        return 1;
    }
    return 0;
}
