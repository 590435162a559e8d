// What does a better tree cost, and what is it worth? ploc and hploc against Embree's binned SAH
// builder, in one process, in turn (A B A B ...), every peer with memory of its own that it keeps
// from build to build:
//   embree_tree    rtcBuildBVH, quality MEDIUM, two children a node, same leaf limit, costs 1 and
//   1; filling
//                  its array of boxes is not in its time
//   embree_scene   commit of a MEDIUM scene whose vertices all moved
// and with --high also embree_tree_high and embree_scene_high: the same with quality HIGH, which
// splits triangles. Ratios of sbvh are then to these, of time and of SAH.
// raydix's times run from vertices and indices to a tree that can be traced. SAH is computed by
// tree_stats for all trees; rays go through all trees by raydix's scalar kernel. JSON lines on
// standard output, a table on standard error.
#include <fmt/format.h>
#include <raydix/check.h>
#include <raydix/machine.h>
#include <raydix/raydix.h>

#include <CLI/CLI.hpp>
#include <map>
#include <nlohmann/json.hpp>

#include "embree_scene.h"
#include "embree_tree.h"
#include "measure/stopwatch.h"

namespace {

using raydix::Stopwatch;
using Json = nlohmann::ordered_json;

struct Options {
    std::vector<std::string> scenes;
    std::vector<std::string> builders = {"ploc"};
    int threads = 2, rounds = 5, max_leaf = 4, samples = 4;
    std::uint32_t width = 640, height = 480;
    bool trace = true, high = false;
};

double median(std::vector<double> v) {
    std::sort(v.begin(), v.end());
    return v[v.size() / 2];
}

struct Times {
    std::vector<double> values;

    void add(double ms) { values.push_back(ms); }
    [[nodiscard]] Json json() const {
        return {{"median", median(values)},
                {"min", *std::min_element(values.begin(), values.end())},
                {"max", *std::max_element(values.begin(), values.end())}};
    }
};

/// One tree that is traced, with all that is measured of it.
struct Peer {
    raydix::Bvh bvh;
    Times build_ms, primary_mrays, diffuse_mrays;
    std::optional<double> sah;
};

struct RayBatch {
    std::vector<raydix::Ray> primary, diffuse;
};

RayBatch make_rays(const raydix::Model& scene, const raydix::Bvh& bvh, const Options& options) {
    RayBatch all;
    const auto append = [](std::vector<raydix::Ray>& to, const std::vector<raydix::Ray>& from) {
        to.insert(to.end(), from.begin(), from.end());
    };
    for (const raydix::Camera& camera : scene.cameras.cameras) {
        std::vector<std::uint32_t> pixels;
        const auto primary =
            raydix::make_primary_rays(camera, options.width, options.height, &pixels);
        append(all.primary, primary);
        raydix::SecondaryOptions secondary;
        secondary.kind = raydix::RayKind::diffuse;
        secondary.samples = options.samples;
        append(all.diffuse, raydix::make_secondary_rays(bvh, primary, raydix::trace(bvh, primary),
                                                        pixels, secondary));
    }
    return all;
}

/// Rates of all trees in turn; all must give the same hits.
void trace_all(std::map<std::string, Peer>& peers, const RayBatch& rays, const Options& options) {
    raydix::TraceOptions trace;
    trace.threads = options.threads;
    const auto measure = [&](const std::vector<raydix::Ray>& batch, Times Peer::*times) {
        std::vector<raydix::Hit> expected(batch.size()), hits(batch.size());
        raydix::trace(peers.begin()->second.bvh, batch, expected, trace);
        for (int round = 0; round < options.rounds; ++round)
            for (auto& [name, peer] : peers) {
                Stopwatch watch;
                raydix::trace(peer.bvh, batch, hits, trace);
                (peer.*times).add(static_cast<double>(batch.size()) / watch.lap() * 1e-3);
                if (std::memcmp(hits.data(), expected.data(), hits.size() * sizeof(raydix::Hit)))
                    throw std::runtime_error("hits through the tree of " + name + " differ");
            }
    };
    measure(rays.primary, &Peer::primary_mrays);
    measure(rays.diffuse, &Peer::diffuse_mrays);
}

void print_table(const Json& result) {
    fmt::print(stderr, "{} ({} triangles, {} threads)\n", result["scene"].get<std::string>(),
               result["triangles"].get<std::size_t>(), result["threads"].get<int>());
    fmt::print(stderr, "{:<18}{:>10}{:>10}{:>10}{:>10}{:>12}{:>12}{:>8}\n", "tree", "ms", "min",
               "max", "SAH", "primary", "diffuse", "depth");
    for (const auto& entry : result["peers"].items()) {
        const Json& p = entry.value();
        const auto number = [&](const Json& j) { return j.is_null() ? 0.0 : j.get<double>(); };
        const auto rate = [&](const char* key) {
            return p.contains(key) ? number(p[key]["median"]) : 0.0;
        };
        fmt::print(stderr, "{:<18}{:>10.1f}{:>10.1f}{:>10.1f}{:>10.3f}{:>12.3f}{:>12.3f}{:>8}\n",
                   entry.key(), number(p["build_ms"]["median"]), number(p["build_ms"]["min"]),
                   number(p["build_ms"]["max"]), p.contains("sah") ? number(p["sah"]) : 0.0,
                   rate("primary_mrays_per_s"), rate("diffuse_mrays_per_s"),
                   p.contains("max_depth") ? p["max_depth"].get<int>() : 0);
    }
    for (const auto& [name, ratio] : result["ratios"].items())
        fmt::print(stderr, "{} time / faster of Embree's: {:.3f}, SAH / Embree's: {:.3f}\n", name,
                   ratio["time"].get<double>(), ratio["sah"].get<double>());
}

Json run(const std::string& scene_name, const Options& options) {
    raydix::Model scene = raydix::load_flat_model(scene_name);
    scene.mesh().vertices.reserve(scene.mesh().vertices.size() + 1);  // Embree reads past the last
    std::map<std::string, Peer> peers;
    std::map<std::string, raydix::BvhBuilder> builders;
    raydix::bench::EmbreeTree tree(scene.mesh(), options.threads, options.max_leaf);
    raydix::bench::EmbreeScene embree(scene.mesh(), {options.threads, RTC_BUILD_QUALITY_MEDIUM});
    std::optional<raydix::bench::EmbreeTree> high_tree;
    std::optional<raydix::bench::EmbreeScene> high_scene;
    if (options.high) {
        high_tree.emplace(scene.mesh(), options.threads, options.max_leaf, RTC_BUILD_QUALITY_HIGH);
        high_scene.emplace(scene.mesh(),
                           raydix::bench::EmbreeOptions{options.threads, RTC_BUILD_QUALITY_HIGH});
    }
    Times scene_ms, high_scene_ms;
    for (int round = -1; round < options.rounds; ++round) {  // the first one warms up
        Stopwatch watch;
        const auto note = [&](Times& times) {
            const double ms = watch.lap();
            if (round >= 0) times.add(ms);
        };
        for (const std::string& name : options.builders) {
            raydix::BuildOptions build;
            build.builder = raydix::builder_from_name(name);
            build.threads = options.threads;
            build.max_leaf = options.max_leaf;
            watch.lap();
            builders[name].build(scene.mesh(), build, peers[name].bvh);
            note(peers[name].build_ms);
        }
        tree.refill();
        watch.lap();
        tree.build();
        note(peers["embree_tree"].build_ms);
        embree.touch();
        watch.lap();
        embree.commit();
        note(scene_ms);
        if (!options.high) continue;
        high_tree->refill();
        watch.lap();
        high_tree->build();
        note(peers["embree_tree_high"].build_ms);
        high_scene->touch();
        watch.lap();
        high_scene->commit();
        note(high_scene_ms);
    }
    if (options.high) peers["embree_tree_high"].bvh = high_tree->as_bvh(scene.mesh());
    peers["embree_tree"].bvh = tree.as_bvh(scene.mesh());
    if (options.trace && !scene.cameras.cameras.empty())
        trace_all(peers, make_rays(scene, peers["embree_tree"].bvh, options), options);

    Json result = {{"scene", scene.name},
                   {"triangles", scene.mesh().triangles.size()},
                   {"threads", options.threads},
                   {"rounds", options.rounds},
                   {"max_leaf", options.max_leaf},
                   {"memory", "kept"},
                   {"cpu", raydix::machine_info().cpu},
                   {"version", raydix::version}};
    for (auto& [name, peer] : peers) {
        const raydix::CheckReport report = raydix::check(peer.bvh);
        if (!report.ok) throw std::runtime_error(name + ": " + report.broken);
        const raydix::TreeStats stats = raydix::tree_stats(peer.bvh);
        peer.sah = stats.sah;
        Json& p = result["peers"][name];
        p = {{"build_ms", peer.build_ms.json()},
             {"sah", stats.sah ? Json(*stats.sah) : Json()},
             {"nodes", stats.nodes},
             {"references", stats.references},
             {"max_depth", stats.max_depth}};
        if (!peer.primary_mrays.values.empty()) {
            p["primary_mrays_per_s"] = peer.primary_mrays.json();
            p["diffuse_mrays_per_s"] = peer.diffuse_mrays.json();
        }
    }
    result["peers"]["embree_scene"] = {{"build_ms", scene_ms.json()}};
    if (options.high) result["peers"]["embree_scene_high"] = {{"build_ms", high_scene_ms.json()}};
    for (const std::string& name : options.builders) {
        const bool high = options.high && name == "sbvh";
        const Peer& peer = peers[high ? "embree_tree_high" : "embree_tree"];
        const double embree_ms = std::min(median((high ? high_scene_ms : scene_ms).values),
                                          median(peer.build_ms.values));
        result["ratios"][name] = {{"time", median(peers[name].build_ms.values) / embree_ms},
                                  {"sah", peers[name].sah.value_or(0) / peer.sah.value_or(1)}};
    }
    return result;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Builders that look at surface area, against Embree's: time, SAH, rays.");
    Options options;
    app.add_option("scenes", options.scenes, "Scenes")->required();
    app.add_option("--builders", options.builders, "raydix's builders")->capture_default_str();
    app.add_option("--threads", options.threads, "Threads")->capture_default_str();
    app.add_option("--rounds", options.rounds, "Rounds after one to warm up")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    app.add_option("--max-leaf", options.max_leaf, "Most triangles in a leaf")
        ->check(CLI::Range(1, 8))
        ->capture_default_str();
    app.add_option("--samples", options.samples, "Diffuse rays per primary hit")
        ->capture_default_str();
    app.add_option("--width", options.width, "Pixels per row")->capture_default_str();
    app.add_option("--height", options.height, "Rows of pixels")->capture_default_str();
    app.add_flag("--high", options.high, "Embree's trees of quality HIGH too, for sbvh");
    app.add_flag("!--no-trace", options.trace, "Trace no rays");
    CLI11_PARSE(app, argc, argv);
    try {
        for (const std::string& scene : options.scenes) {
            const Json result = run(scene, options);
            fmt::print("{}\n", result.dump());
            std::fflush(stdout);
            print_table(result);
        }
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench_quality: {}\n", error.what());
        return 1;
    }
    return 0;
}
