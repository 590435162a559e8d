// How much work do rays have in wide trees? Nodes entered and triangles tested per ray by `scalar`,
// in 4- and 8-wide trees with float32 boxes, and by `cwbvh`; sizes; milliseconds of the collapse
// and of the compression. Every hit is compared with scalar's. A JSON line per scene, tree and kind
// of rays on standard output. The counts do not depend on the machine.
#include <fmt/format.h>
#include <raydix/cwbvh.h>
#include <raydix/machine.h>
#include <raydix/model.h>
#include <raydix/rays.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "exec/parallel.h"
#include "layout/wide_collapse.h"
#include "tests/support/cwbvh_trace.h"
#include "tests/support/wide_walk.h"
#include "trace/triangle_test.h"

namespace {

using Json = nlohmann::ordered_json;

struct Options {
    std::vector<std::string> scenes{"builtin:atrium?triangles=300000"};
    std::vector<std::string> builders{"karras", "ploc", "binned"};
    int max_leaf = 1;
    std::uint32_t width = 256, height = 192;
    int samples = 4, repeat = 3;
    std::uint64_t seed = 1;
};

double ms_of(int repeat, const auto& work) {
    std::vector<double> ms;
    for (int i = 0; i < repeat; ++i) {
        const auto start = std::chrono::steady_clock::now();
        work();
        ms.push_back(
            1e3 * std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    }
    std::ranges::sort(ms);
    return ms[ms.size() / 2];
}

void expect_same(std::span<const raydix::Hit> hits, std::span<const raydix::Hit> wanted,
                 const char* kernel) {
    if (std::memcmp(hits.data(), wanted.data(), hits.size_bytes()) != 0)
        throw std::runtime_error(std::string(kernel) + " finds other hits than scalar");
}

Json per_ray(const raydix::TraceCounts& counts) {
    const auto rays = static_cast<double>(counts.rays);
    return {{"node_visits_per_ray", static_cast<double>(counts.node_visits) / rays},
            {"triangle_tests_per_ray", static_cast<double>(counts.triangle_tests) / rays}};
}

struct Visits {
    raydix::TraceCounts& counts;
    void visit() { ++counts.node_visits; }
};

raydix::TraceCounts trace_wide(const raydix::Bvh& bvh, const raydix::WideTree& tree,
                               std::span<const raydix::Ray> rays, std::span<raydix::Hit> hits) {
    raydix::TraceCounts counts;
    counts.rays = rays.size();
    raydix::WideStack stack(tree);
    Visits steps{counts};
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!is_valid(rays[i])) continue;
        const raydix::RayFrame ray = make_frame(rays[i]);
        raydix::Hit best{ray.tmax, raydix::no_primitive, 0, 0};
        const auto leaf = [&](const raydix::BvhNode& child) {
            for (std::uint32_t k = child.first; k < child.first + child.count; ++k) {
                raydix::TriangleHit hit;
                ++counts.triangle_tests;
                if (intersect_triangle<raydix::EdgeRule::closed>(ray, bvh.triangles()[k], best.t,
                                                                 hit) &&
                    (hit.t < best.t || bvh.order()[k] < best.prim))
                    best = {hit.t, bvh.order()[k], hit.u, hit.v};
            }
            return false;
        };
        walk_wide(tree, bvh.bounds(), ray, stack, steps, leaf, [&] { return best.t; });
        if (best.hit()) hits[i] = {best.t * ray.t_scale, best.prim, best.u, best.v};
    }
    return counts;
}

Json work_of(const raydix::Bvh& bvh, const raydix::Cwbvh& cwbvh,
             std::span<const raydix::Ray> rays) {
    std::vector<raydix::Hit> wanted(rays.size()), hits(rays.size());
    Json work{{"rays", rays.size()}};
    work["scalar"] = per_ray(trace(bvh, rays, wanted, {.counters = true}));
    for (const int width : {4, 8}) {
        const auto tree = collapse_to_wide(bvh, {.width = width});
        hits.assign(rays.size(), raydix::Hit{});
        work["wide" + std::to_string(width)] = per_ray(trace_wide(bvh, tree, rays, hits));
        expect_same(hits, wanted, "wide");
    }
    work["cwbvh"] = per_ray(trace(cwbvh, rays, hits));
    expect_same(hits, wanted, "cwbvh");
    return work;
}

Json tree_json(const raydix::Bvh& bvh, const raydix::Cwbvh& cwbvh, int repeat) {
    const raydix::CwbvhStats& s = cwbvh.stats();
    Json json{{"sah_binary", nullptr},
              {"sah_wide", s.sah},
              {"nodes", s.nodes},
              {"children_per_node", s.children_per_node},
              {"max_depth", s.max_depth},
              {"widening", s.widening},
              {"bytes", s.bytes},
              {"node_bytes_per_triangle",
               static_cast<double>(s.node_bytes) / static_cast<double>(s.triangles)},
              {"bytes_per_triangle", s.bytes_per_triangle},
              {"bytes_per_triangle_binary",
               static_cast<double>(bvh.bytes()) / static_cast<double>(s.triangles)}};
    if (const auto sah = tree_stats(bvh, {.with_hash = false}).sah) json["sah_binary"] = *sah;
    for (const int width : {4, 8})
        json["collapse" + std::to_string(width) + "_ms"] =
            ms_of(repeat, [&] { static_cast<void>(collapse_to_wide(bvh, {.width = width})); });
    json["cwbvh_ms"] = ms_of(repeat, [&] { const raydix::Cwbvh again(bvh); });
    return json;
}

void run(const Options& options) {
    for (const std::string& name : options.scenes) {
        const raydix::Model scene = raydix::load_flat_model(name, options.seed);
        for (const std::string& builder : options.builders) {
            const raydix::Bvh bvh = build_bvh(
                scene.mesh(),
                {.builder = raydix::builder_from_name(builder), .max_leaf = options.max_leaf});
            const raydix::Cwbvh cwbvh(bvh);
            std::vector<std::uint32_t> pixels;
            const auto primary = make_primary_rays(scene.cameras.cameras.at(0), options.width,
                                                   options.height, &pixels);
            const auto hits = trace(bvh, primary);
            const auto diffuse = make_secondary_rays(bvh, primary, hits, pixels,
                                                     {.kind = raydix::RayKind::diffuse,
                                                      .samples = options.samples,
                                                      .seed = options.seed});
            Json line{{"bench", "wide"},
                      {"cpu", raydix::machine_info().cpu},
                      {"threads", raydix::thread_count()},
                      {"compiler", __VERSION__},
                      {"scene", name},
                      {"seed", options.seed},
                      {"triangles", scene.mesh().triangles.size()},
                      {"builder", builder},
                      {"max_leaf", options.max_leaf},
                      {"repeat", options.repeat}};
            line["tree"] = tree_json(bvh, cwbvh, options.repeat);
            line["primary"] = work_of(bvh, cwbvh, primary);
            line["diffuse"] = work_of(bvh, cwbvh, diffuse);
            fmt::print("{}\n", line.dump());
        }
    }
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Work of rays in wide trees, and what the trees take");
    Options options;
    app.add_option("--scene", options.scenes, "Scenes of triangles")->capture_default_str();
    app.add_option("--builder", options.builders, "Builders")->capture_default_str();
    app.add_option("--max-leaf", options.max_leaf, "Most primitives in a leaf of the binary tree")
        ->capture_default_str();
    app.add_option("--width", options.width, "Pixels of a picture")->capture_default_str();
    app.add_option("--height", options.height, "Pixels of a picture")->capture_default_str();
    app.add_option("--samples", options.samples, "Diffuse rays from each primary hit")
        ->capture_default_str();
    app.add_option("--repeat", options.repeat, "Timed collapses")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    app.add_option("--seed", options.seed, "Seed of built-in scenes")->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try {
        run(options);
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench_wide: {}\n", error.what());
        return 1;
    }
    return 0;
}
