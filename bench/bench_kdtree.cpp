// How fast is the k-d tree? Nearest neighbours over points, and rays through it beside the BVH's
// scalar kernel, both trees in one run, in turns (A B A B). Answers are compared first. One JSON
// line a question.
#include <fmt/format.h>
#include <raydix/kdtree.h>
#include <raydix/machine.h>
#include <raydix/raydix.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstring>
#include <functional>
#include <nlohmann/json.hpp>
#include <numeric>
#include <random>

#include "measure/stopwatch.h"

namespace {

using namespace raydix;
using Json = nlohmann::ordered_json;

struct Options {
    std::string points = "builtin:uniform?points=1000000",
                scene = "builtin:atrium?triangles=500000";
    int threads = 2, repeat = 5, max_leaf = 0, bits = 63, samples = 8;
    std::uint32_t k = 8, queries = 200'000;
    std::uint64_t seed = 1;
};

Json spread_json(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    const std::size_t n = values.size();
    const double median = n % 2 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
    return {{"median", median}, {"min", values.front()}, {"max", values.back()}};
}

/// Millions a second of each of the works, run in turns after one warm-up each.
std::vector<Json> rates_in_turns(const std::vector<std::function<void()>>& works, double count,
                                 int repeat) {
    for (const auto& work : works) work();
    std::vector<std::vector<double>> rates(works.size());
    for (int i = 0; i < repeat; ++i)
        for (std::size_t k = 0; k < works.size(); ++k) {
            Stopwatch watch;
            works[k]();
            rates[k].push_back(count / (watch.lap() * 1e3));
        }
    std::vector<Json> result;
    for (const auto& of_one : rates) result.push_back(spread_json(of_one));
    return result;
}

/// The row of one query by looking at every point.
std::vector<KdNeighbor> nearest_of_all(std::span<const Vec3> points, Vec3 q, std::uint32_t k) {
    std::vector<KdNeighbor> all;
    for (std::uint32_t i = 0; i < points.size(); ++i) {
        const float dx = points[i].x - q.x, dy = points[i].y - q.y, dz = points[i].z - q.z;
        all.push_back({(dx * dx + dy * dy) + dz * dz, i});
    }
    const std::size_t kept = std::min<std::size_t>(k, all.size());
    std::partial_sort(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(kept), all.end(),
                      [](const KdNeighbor& a, const KdNeighbor& b) {
                          return a.d2 != b.d2 ? a.d2 < b.d2 : a.point < b.point;
                      });
    all.resize(kept);
    all.resize(k, KdNeighbor{});
    return all;
}

void compare_some_rows(std::span<const Vec3> points, std::span<const Vec3> queries,
                       std::span<const KdNeighbor> found, std::uint32_t k) {
    const std::size_t step = std::max<std::size_t>(1, queries.size() / 20);
    for (std::size_t q = 0; q < queries.size(); q += step) {
        const std::vector<KdNeighbor> wanted = nearest_of_all(points, queries[q], k);
        if (std::memcmp(wanted.data(), found.data() + q * k, k * sizeof(KdNeighbor)) != 0)
            throw InputError("neighbours of query " + std::to_string(q) + " are wrong");
    }
}

Json settings(const Options& options, const KdTree& tree, const std::string& scene) {
    return {{"scene", scene},
            {"cpu", machine_info().cpu},
            {"threads", options.threads},
            {"seed", options.seed},
            {"repeat", options.repeat},
            {"bits", options.bits},
            {"max_leaf", tree.options().max_leaf},
            {"references", tree.order().size()},
            {"nodes", kd_stats(tree).nodes},
            {"bytes", tree.bytes()},
            {"build_ms", tree.build_ms().total}};
}

KdTreeOptions tree_options(const Options& options) {
    return {.bits = options.bits, .max_leaf = options.max_leaf, .threads = options.threads};
}

/// Points of the set in random order, and in the order of the tree's leaves.
void bench_nearest(const Options& options) {
    const Model scene = load_flat_model(options.points, options.seed);
    if (!scene.mesh().is_point_cloud()) throw InputError(options.points + ": not a set of points");
    const KdTree tree = build_kdtree(scene.mesh(), tree_options(options));
    std::vector<std::uint32_t> positions(tree.order().size());
    std::iota(positions.begin(), positions.end(), 0u);
    std::shuffle(positions.begin(), positions.end(), std::mt19937_64(options.seed));
    positions.resize(std::min<std::size_t>(positions.size(), options.queries));
    std::vector<Vec3> random, ordered;
    for (const std::uint32_t i : positions) random.push_back(tree.points()[i]);
    std::sort(positions.begin(), positions.end());
    for (const std::uint32_t i : positions) ordered.push_back(tree.points()[i]);

    std::vector<KdNeighbor> found(random.size() * options.k);
    const KdQueryCounts counts =
        kd_nearest(tree, random, options.k, found, {.threads = options.threads, .counters = true});
    compare_some_rows(scene.mesh().vertices, random, found, options.k);
    const auto run = [&](const std::vector<Vec3>& queries) {
        return [&] { kd_nearest(tree, queries, options.k, found, {.threads = options.threads}); };
    };
    const auto rates = rates_in_turns({run(random), run(ordered)},
                                      static_cast<double>(random.size()), options.repeat);
    Json line = settings(options, tree, scene.name);
    line["question"] = "nearest";
    line["k"] = options.k;
    line["queries"] = random.size();
    line["mqueries_per_s"] = {{"random", rates[0]}, {"ordered", rates[1]}};
    const auto n = static_cast<double>(random.size());
    line["node_visits_per_query"] = static_cast<double>(counts.node_visits) / n;
    line["distances_per_query"] = static_cast<double>(counts.distances) / n;
    fmt::print("{}\n", line.dump());
}

Json counts_json(const TraceCounts& counts, const Json& rate) {
    const auto n = static_cast<double>(counts.rays);
    return {{"mrays_per_s", rate},
            {"node_visits_per_ray", static_cast<double>(counts.node_visits) / n},
            {"triangle_tests_per_ray", static_cast<double>(counts.triangle_tests) / n}};
}

void bench_rays_of(const std::string& kind, const Options& options, const Model& scene,
                   const KdTree& tree, const Bvh& bvh, std::span<const Ray> rays) {
    std::vector<Hit> by_tree(rays.size()), by_bvh(rays.size());
    const TraceOptions counting{.threads = options.threads, .counters = true},
        plain{.threads = options.threads};
    const TraceCounts of_tree = kd_trace(tree, rays, by_tree, counting);
    const TraceCounts of_bvh = trace(bvh, rays, by_bvh, counting);
    if (std::memcmp(by_tree.data(), by_bvh.data(), rays.size() * sizeof(Hit)) != 0)
        throw InputError("hits of " + kind + " rays differ");
    const auto rates = rates_in_turns(
        {[&] { kd_trace(tree, rays, by_tree, plain); }, [&] { trace(bvh, rays, by_bvh, plain); }},
        static_cast<double>(rays.size()), options.repeat);
    Json line = settings(options, tree, scene.name);
    line["question"] = "rays";
    line["rays"] = kind;
    line["count"] = rays.size();
    line["hits"] = of_tree.hits;
    line["kdtree"] = counts_json(of_tree, rates[0]);
    line["bvh"] = counts_json(of_bvh, rates[1]);
    fmt::print("{}\n", line.dump());
}

void bench_rays(const Options& options) {
    const Model scene = load_flat_model(options.scene, options.seed);
    const KdTree tree = build_kdtree(scene.mesh(), tree_options(options));
    const Bvh bvh = build_bvh(scene.mesh(), {.bits = options.bits, .threads = options.threads});
    std::vector<std::uint32_t> pixels;
    const std::vector<Ray> primary = make_primary_rays(scene.cameras.cameras[0], 512, 384, &pixels);
    bench_rays_of("primary", options, scene, tree, bvh, primary);
    const std::vector<Hit> hits = trace(bvh, primary);
    for (const bool sorted : {true, false}) {
        SecondaryOptions secondary;
        secondary.kind = sorted ? RayKind::diffuse : RayKind::diffuse_shuffled;
        secondary.samples = options.samples;
        secondary.seed = options.seed;
        secondary.threads = options.threads;
        const std::vector<Ray> rays = make_secondary_rays(bvh, primary, hits, pixels, secondary);
        bench_rays_of(sorted ? "diffuse" : "diffuse_shuffled", options, scene, tree, bvh, rays);
    }
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Rates of nearest neighbours and of rays through the k-d tree.");
    Options options;
    app.add_option("--points", options.points, "Points")->capture_default_str();
    app.add_option("--scene", options.scene, "Triangles")->capture_default_str();
    app.add_option("--threads", options.threads, "Threads")->capture_default_str();
    app.add_option("--repeat", options.repeat, "Timed turns")
        ->check(CLI::Range(1, 10000))
        ->capture_default_str();
    app.add_option("--max-leaf", options.max_leaf,
                   "Most primitives in a leaf of the k-d tree; 0: its default")
        ->capture_default_str();
    app.add_option("--bits", options.bits, "Code bits of both trees")->capture_default_str();
    app.add_option("--samples", options.samples, "Diffuse rays per primary hit")
        ->capture_default_str();
    app.add_option("--k", options.k, "Neighbours a query")->capture_default_str();
    app.add_option("--queries", options.queries, "Queries, points of the set")
        ->capture_default_str();
    app.add_option("--seed", options.seed, "Seed of scenes and queries")->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try {
        bench_nearest(options);
        bench_rays(options);
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench_kdtree: {}\n", error.what());
        return 1;
    }
    return 0;
}
