// raydix bench scene: everything that is not one float mesh in large batches, beside Embree.
// Instances, spheres, user geometry, filters, all hits, closest points, commits; doubles beside
// floats. Answers are compared first; then all modes of both sides are timed in turns, in one
// process. Once with the seed that is tuned on, once with one that is not.
#include <fmt/format.h>
#include <raydix/machine.h>

#include "bench_clock.h"
#include "cli/program.h"
#include "embree_api.h"
#include "scene_report.h"
#include "scene_workloads.h"

namespace raydix::bench {
namespace {

using cli::Json;

constexpr std::uint64_t tuned_seed = 1;

/// What runs in seconds, unless a number was given.
void make_quick(const CLI::App& app, SceneBench& options) {
    const auto choose = [&](const char* name, auto& value, auto quick) {
        if (app.get_option(name)->count() == 0) value = quick;
    };
    choose("--instances", options.instances, 64u);
    choose("--plants", options.plants, 200u);
    choose("--shapes", options.shapes, 5000u);
    choose("--moved", options.moved, 300u);
    choose("--queries", options.queries, 2000u);
    choose("--pieces", options.pieces, 20u);
    choose("--frames", options.frames, std::vector<std::uint64_t>{5000});
    choose("--size", options.size, "64x48");
    choose("--rounds", options.rounds, 3);
}

Json options_json(const SceneBench& options, int threads) {
    return {{"quality", options.quality},     {"threads", threads},
            {"rounds", options.rounds},       {"size", options.size},
            {"clock", options.clock},         {"tolerance", options.tolerance},
            {"instances", options.instances}, {"plants", options.plants},
            {"shapes", options.shapes},       {"moved", options.moved},
            {"queries", options.queries},     {"pieces", options.pieces},
            {"frames", options.frames},       {"only", options.only},
            {"quick", options.quick}};
}

void run(const SceneBench& options) {
    const int threads = cli::threads_at_work(options.common.threads);
    const bool tables = options.common.prints_tables();
    std::vector<SceneGroup> groups{{"tuned", tuned_seed, {}}};
    if (options.common.seed != tuned_seed) groups.push_back({"held out", options.common.seed, {}});
    for (SceneGroup& group : groups)
        run_workloads(options, group.seed, threads, [&](const Question& question) {
            const bool first = group.questions.empty();
            if (tables && first && &group == &groups.front())
                fmt::print("Embree {}, {}\n", embree_version(), machine_info().cpu);
            if (tables && first) print_group_head(group, options, threads);
            if (tables) print_question(question, first ? nullptr : &group.questions.back());
            group.questions.push_back(question);
            std::fflush(stdout);
        });
    Json document = cli::new_document("bench scene");
    document["embree"] = embree_version();
    document["options"] = options_json(options, threads);
    document["groups"] = Json::array();
    for (const SceneGroup& group : groups) document["groups"].push_back(group_json(group));
    document["summary"] = summary_json(groups);
    if (tables) print_summary(document["summary"]);
    write_json(document, options.common);
}

void add_counts(CLI::App& app, SceneBench& options) {
    const auto add = [&](const char* name, std::uint64_t& value, const char* what) {
        app.add_option(name, value, what)->check(CLI::Range(1, 100'000'000))->capture_default_str();
    };
    add("--instances", options.instances, "Instances of a mesh");
    add("--plants", options.plants, "Plants");
    add("--shapes", options.shapes, "Spheres, and discs of user geometry");
    add("--moved", options.moved, "Instances that move");
    add("--queries", options.queries, "Queries for closest points");
    add("--pieces", options.pieces, "Meshes beside one merged mesh");
    app.add_option("--frames", options.frames, "Triangles of figures that move")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->check(CLI::Range(5000, 20'000'000))
        ->capture_default_str();
}

void add_options(CLI::App& app, SceneBench& options) {
    app.add_option("SCENE", options.scenes,
                   "Scenes of triangles, and point clouds for spheres (default: built-in ones)");
    app.add_option("--only", options.only, "Workloads")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->check(CLI::IsMember(scene_workloads))
        ->capture_default_str();
    app.add_option("--quality", options.quality,
                   "Our trees, beside Embree's LOW, MEDIUM, or the better of MEDIUM and HIGH")
        ->check(CLI::IsMember({"fast", "balanced", "high"}))
        ->capture_default_str();
    cli::add_size_option(app, options.size,
                         "Pixels of a picture of primary rays; as many random rays are sent")
        ->capture_default_str();
    app.add_option("--rounds", options.rounds, "Timed rounds after answers are compared")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    app.add_option("--tolerance", options.tolerance,
                   "Distances may differ by this part of themselves, or of the origin's size")
        ->check(cli::finite_number(true))
        ->capture_default_str();
    add_clock_option(app, options.clock);
    add_counts(app, options);
    app.add_flag("--quick", options.quick,
                 "Small contents and pictures: seconds, for a first look");
    options.common.seed = 2;
    cli::add_common_options(app, options.common);
    app.get_option("--seed")->description(
        "Seed of the held-out group: placement, viewpoints, rays; 1: the tuned group alone");
}

}  // namespace
}  // namespace raydix::bench

int main(int argc, char** argv) {
    CLI::App app("Instances, spheres, filters, distances beside Embree.", "raydix bench scene");
    raydix::bench::SceneBench options;
    raydix::bench::add_options(app, options);
    app.callback([&] {
        if (options.quick) raydix::bench::make_quick(app, options);
        raydix::bench::run(options);
    });
    return raydix::cli::run_program(app, argc, argv);
}
