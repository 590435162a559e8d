// raydix bench cpu: our CPU tracer beside Embree, on the same scenes, rays and threads. Builds in
// processes of their own; rays from the caller's array of Ray to the caller's array of Hit (ao: 0
// or 1), launch by launch, all modes of all trees in turn, hits compared before anything is timed.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <raydix/error.h>
#include <raydix/machine.h>
#include <raydix/wide.h>

#include <algorithm>

#include "cli/program.h"
#include "cli/simulation.h"
#include "cpu_report.h"
#include "embree_api.h"

namespace raydix::bench {
namespace {

using cli::Json;

class CpuStudy {
public:
    explicit CpuStudy(const CpuBench& options)
        : options_(options),
          threads_(options.common.threads > 0 ? options.common.threads : machine_info().cores),
          thread_counts_{threads_},
          names_(peers_of(options)),
          kinds_(cli::kinds_from(options.rays)) {
        if (options.threads_study && threads_ > 1) thread_counts_.insert(thread_counts_.begin(), 1);
        const std::vector<std::string> known = simd_instruction_sets();
        for (const std::string& isa : options.isas)
            if (isa != "all" && std::find(known.begin(), known.end(), isa) == known.end())
                throw CLI::ValidationError("--isa", fmt::format("'{}' is not all or one of {}", isa,
                                                                fmt::join(known, ", ")));
    }

    void run() {
        const bool tables = options_.common.prints_tables();
        Json document = cli::new_document("bench cpu");
        document["embree"] = embree_version();
        document["options"] = options_json();
        document["scenes"] = Json::array();
        std::vector<SceneFigures> scenes;
        for (const std::string& name : options_.scenes) {
            scenes.push_back(study(name));
            document["scenes"].push_back(figures_json(scenes.back()));
            if (tables && scenes.size() == 1)
                fmt::print("Embree {}, {}; builds in processes of their own, {} rounds\n",
                           embree_version(), machine_info().cpu, options_.rounds);
            if (tables) print_figures(scenes.back());
            std::fflush(stdout);
        }
        document["summary"] = summary_json(scenes);
        if (tables && scenes.size() > 1) print_summary(document["summary"]);
        write_json(document, options_.common);
    }

private:
    Json options_json() const {
        return {{"rounds", options_.rounds},
                {"sample", options_.launches.sample},
                {"samples", options_.launches.samples},
                {"seed", options_.common.seed},
                {"max_leaf", options_.max_leaf},
                {"width", options_.width},
                {"tolerance", options_.tolerance},
                {"instruction_sets", simd_instruction_sets()}};
    }

    SceneFigures study(const std::string& name) {
        cli::TreeOptions tree;
        tree.cameras_file = options_.cameras_file;
        cli::SceneTree input{cli::load_model_with_cameras(name, tree, options_.common), {}};
        Mesh& mesh = input.scene.mesh();
        if (mesh.triangles.empty()) throw InputError(name + ": holds no triangles");
        mesh.vertices.reserve(mesh.vertices.size() + 1);
        SceneFigures figures{.scene = input.scene.name,
                             .triangles = mesh.triangles.size(),
                             .threads = threads_,
                             .peers = names_,
                             .builds = {},
                             .kinds = {}};
        if (!options_.no_builds) figures.builds = measure_builds(name, options_, thread_counts_);
        if (options_.no_rays) return figures;
        cli::about(name, [&] {
            input.bvh = build_bvh(mesh, {.builder = Builder::ploc, .threads = threads_});
            trace_all(input, figures);
        });
        return figures;
    }

    void trace_all(const cli::SceneTree& input, SceneFigures& figures) const {
        std::vector<std::unique_ptr<Peer>> peers;
        for (const PeerName& name : names_) {
            peers.push_back(make_peer(name, input.scene.mesh(), options_, threads_));
            peers.back()->prepare();
            peers.back()->build();
        }
        cli::LaunchOptions whole = options_.launches;
        whole.sample = 1.0;  // a part of a picture's rays is too short a batch to be timed
        const cli::RayLaunches pictures(whole, input, options_.common);
        const cli::RayLaunches sampled(options_.launches, input, options_.common);
        for (const RayKind kind : kinds_)
            figures.kinds.push_back(measure_rates(kind,
                                                  kind == RayKind::primary ? pictures : sampled,
                                                  names_, peers, options_, thread_counts_));
    }

    const CpuBench& options_;
    int threads_;
    std::vector<int> thread_counts_;
    std::vector<PeerName> names_;
    std::vector<RayKind> kinds_;
};

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
                 "Our batch calls also one by one, in packets, as streams, sorted");
    app.add_option("--max-leaf", options.max_leaf, "Most triangles in a leaf of our binary trees")
        ->check(CLI::Range(1, 255))
        ->capture_default_str();
    app.add_option("--width", options.width, "Children of our wide nodes")
        ->check(CLI::IsMember({4, 8}))
        ->capture_default_str();
}

void add_measuring_options(CLI::App& app, CpuBench& options) {
    app.add_option("--rays", options.rays,
                   "primary, ao, diffuse, diffuse_shuffled, separated by commas, or all")
        ->capture_default_str();
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
    app.add_option("SCENE", options.scenes, "Scenes of triangles")->required();
    raydix::bench::add_peer_options(app, options);
    raydix::bench::add_measuring_options(app, options);
    options.launches.sample = 0.05;
    raydix::cli::add_launch_options(app, options.launches);
    app.get_option("--sample")
        ->description(
            "Part of the ao and diffuse rays: whole launches, or runs of neighbouring rays. "
            "Pictures "
            "of primary rays are always whole");
    raydix::cli::add_common_options(app, options.common);
    app.callback([&options] {
        if (options.build_of.empty())
            raydix::bench::CpuStudy(options).run();
        else
            raydix::bench::print_builds_of_one_peer(options);
    });
    return raydix::cli::run_program(app, argc, argv);
}
