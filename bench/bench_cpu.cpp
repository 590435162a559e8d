// raydix bench cpu: our CPU tracer beside Embree, on the same scenes, rays and threads. Builds in
// processes of their own; rays from the caller's array of Ray to the caller's array of Hit (any
// hit: 0 or 1), workload by workload, all modes of all trees in turn, hits compared before anything
// is timed.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <raydix/machine.h>
#include <raydix/wide.h>

#include <algorithm>

#include "bench_clock.h"
#include "cli/program.h"
#include "cpu_builds.h"
#include "cpu_study.h"
#include "cpu_workloads.h"

namespace raydix::bench {
namespace {

void check_options(const CpuBench& options) {
    if (options.scenes.empty() && options.held_out.empty()) throw CLI::RequiredError("SCENE");
    if (options.resume && (options.common.json_file.empty() || options.common.json_file == "-"))
        throw CLI::ValidationError("--resume", "needs --json FILE, which it goes on with");
    const std::vector<std::string> known = simd_instruction_sets();
    for (const std::string& isa : options.isas)
        if (isa != "all" && std::ranges::find(known, isa) == known.end())
            throw CLI::ValidationError(
                "--isa", fmt::format("'{}' is not all or one of {}", isa, fmt::join(known, ", ")));
}

void add_peer_options(CLI::App& app, CpuBench& options) {
    const auto list = [&](const char* name, std::vector<std::string>& values, const char* what) {
        return app.add_option(name, values, what)->delimiter(',')->allow_extra_args(false);
    };
    list("--quality", options.qualities, "Our builds")
        ->check(CLI::IsMember(
            {"fast", "balanced", "high", "fast+compact", "balanced+compact", "high+compact"}))
        ->capture_default_str();
    list("--embree", options.embree,
         "Embree's builds: low, medium or high, each also with +compact, +robust")
        ->capture_default_str();
    list("--isa", options.isas,
         "Instruction sets of our batch calls, or all (default: the best that the processor has)");
    app.add_flag("--all-paths", options.all_paths,
                 "Our batch calls also one by one, in packets, as streams, sorted; Embree's ROBUST "
                 "trees also in packets");
}

void add_measuring_options(CLI::App& app, CpuBench& options) {
    app.add_option(
           "--workloads", options.workloads,
           "Names separated by commas, or all. Each name also with @N: in calls of N rays. " +
               workload_kinds())
        ->capture_default_str();
    app.add_option("--held-out", options.held_out,
                   "A scene that nobody tunes on: its summary stands apart")
        ->type_name("SCENE")
        ->allow_extra_args(false);
    app.add_flag("--resume", options.resume,
                 "Go on with the document of --json, which is written after each workload");
    app.add_option("--cameras", options.cameras_file,
                   "Cameras file instead of cameras.json beside the scene")
        ->type_name("FILE");
    app.add_option("--rounds", options.rounds, "Timed rounds after a warm-up that compares hits")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    app.add_option("--tolerance", options.tolerance,
                   "Distances may differ by this part of themselves, or of the origin's size")
        ->check(cli::finite_number(true))
        ->capture_default_str();
    add_clock_option(app, options.clock);
    app.add_flag("--threads-study", options.threads_study, "Everything with one thread, too");
    app.add_flag("--sah", options.sah, "Also SAH of the binary trees (Embree's by rtcBuildBVH)");
    CLI::Option* no_builds = app.add_flag("--no-builds", options.no_builds, "Time no builds");
    app.add_flag("--no-rays", options.no_rays, "Time no rays")->excludes(no_builds);
    app.add_option("--build-of", options.build_of)->group("");  // for processes of its own
}

}  // namespace
}  // namespace raydix::bench

int main(int argc, char** argv) {
    CLI::App app("The CPU tracer beside Embree: builds, bytes, rays.", "raydix bench cpu");
    raydix::bench::CpuBench options;
    app.add_option("SCENE", options.scenes, "Scenes of triangles");
    raydix::bench::add_peer_options(app, options);
    raydix::bench::add_measuring_options(app, options);
    options.launches.sample = 0.05;  // of pictures of the size below: a launch for each camera
    options.launches.launch_rays = 1u << 19;
    options.launches.size_text = "512x384";
    raydix::cli::add_launch_options(app, options.launches);
    app.get_option("--size")->description("Pixels of each picture")->capture_default_str();
    app.get_option("--sample")
        ->description(
            "Part of the rays of ao, diffuse and diffuse_shuffled: whole launches, or runs of "
            "neighbouring rays");
    raydix::cli::add_common_options(app, options.common);
    app.callback([&options] {
        raydix::bench::check_options(options);
        if (options.build_of.empty())
            raydix::bench::run_study(options);
        else
            raydix::bench::print_builds_of_one_peer(options);
    });
    return raydix::cli::run_program(app, argc, argv);
}
