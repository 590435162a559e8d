// One peer builds one scene in this process: the first build, then builds again into kept memory.
// JSON on standard output. bench/build_vs_embree.py runs the peers in turn, since peers in one
// process disturb each other's memory.
#include <fmt/format.h>
#include <raydix/bvh.h>
#include <raydix/machine.h>
#include <raydix/raydix.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "measure/stopwatch.h"
#ifdef RAYDIX_EMBREE_MAJOR
#include "embree_scene.h"
#endif

namespace {

using raydix::Stopwatch;
using Json = nlohmann::ordered_json;

struct Options {
    std::string scene = "builtin:figure?triangles=1000000", peer = "raydix", builder = "apetrei";
    int threads = 2, repeat = 5, bits = 63, max_leaf = 4;
};

Json stage_json(const raydix::BuildMs& ms) {
    return {{"bounds", ms.bounds},       {"codes", ms.codes}, {"sort", ms.sort},
            {"hierarchy", ms.hierarchy}, {"fit", ms.fit},     {"layout", ms.layout},
            {"total", ms.total}};
}

/// Pages that this process has touched for the first time so far.
long page_faults() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_minflt;
}

Json run_raydix(const raydix::Mesh& mesh, const Options& options) {
    raydix::BuildOptions build;
    build.threads = options.threads;
    build.bits = options.bits;
    build.max_leaf = options.max_leaf;
    build.builder = raydix::builder_from_name(options.builder);
    raydix::BvhBuilder builder;
    raydix::Bvh bvh;
    Json stages = Json::array(), rebuilds = Json::array();
    Stopwatch watch;
    const long faults_before = page_faults();
    builder.build(mesh, build, bvh);
    const double first = watch.lap();
    const long first_faults = page_faults() - faults_before;
    Json first_stages = stage_json(bvh.build_ms());
    for (int i = 0; i < options.repeat; ++i) {
        watch.lap();
        builder.build(mesh, build, bvh);
        rebuilds.push_back(watch.lap());
        stages.push_back(stage_json(bvh.build_ms()));
    }
    return {{"first_ms", first},
            {"first_page_faults", first_faults},
            {"rebuild_ms", rebuilds},
            {"first_stages", first_stages},
            {"stages", stages},
            {"bytes", bvh.bytes()},
            {"peak_bytes", bvh.peak_bytes()},
            {"tree_hash", tree_hash(bvh)}};
}

#ifdef RAYDIX_EMBREE_MAJOR
/// Scene and geometry quality LOW with the dynamic flag: Embree's Morton builder.
Json run_embree(const raydix::Mesh& mesh, const Options& options) {
    raydix::bench::EmbreeScene scene(
        mesh, {options.threads, RTC_BUILD_QUALITY_LOW, RTC_SCENE_FLAG_DYNAMIC});
    Stopwatch watch;
    scene.commit();
    const double first = watch.lap();
    Json rebuilds = Json::array();
    for (int i = 0; i < options.repeat; ++i) {
        scene.touch();
        watch.lap();
        scene.commit();
        rebuilds.push_back(watch.lap());
    }
    return {{"first_ms", first}, {"rebuild_ms", rebuilds}};
}
#endif

Json run(const Options& options) {
    raydix::Model scene = raydix::load_flat_model(options.scene);
    scene.mesh().vertices.reserve(scene.mesh().vertices.size() +
                                  1);  // Embree reads past the last vertex
    Json result;
    if (options.peer == "raydix") {
        result = run_raydix(scene.mesh(), options);
#ifdef RAYDIX_EMBREE_MAJOR
    } else if (options.peer == "embree") {
        result = run_embree(scene.mesh(), options);
#endif
    } else {
        throw raydix::InputError("no such peer in this program: " + options.peer);
    }
    result["peer"] = options.peer;
    result["scene"] = scene.name;
    result["triangles"] = scene.mesh().triangles.size();
    result["threads"] = options.threads;
    result["bits"] = options.bits;
    result["cpu"] = raydix::machine_info().cpu;
    return result;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Times the builds of one peer on one scene.");
    Options options;
    app.add_option("--scene", options.scene, "Scene")->capture_default_str();
    app.add_option("--peer", options.peer, "raydix or embree")->capture_default_str();
    app.add_option("--threads", options.threads, "Threads")->capture_default_str();
    app.add_option("--builder", options.builder, "Builder of raydix")->capture_default_str();
    app.add_option("--repeat", options.repeat, "Builds after the first")->capture_default_str();
    app.add_option("--bits", options.bits, "Code bits")->capture_default_str();
    app.add_option("--max-leaf", options.max_leaf, "Most triangles in a leaf")
        ->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try {
        fmt::print("{}\n", run(options).dump());
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench_build: {}\n", error.what());
        return 1;
    }
    return 0;
}
