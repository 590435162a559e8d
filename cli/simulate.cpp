// raydix simulate: what the kernels of Aila and Laine 2009 could reach on a simulated machine.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <raydix/error.h>

#include <memory>
#include <optional>

#include "option_checks.h"
#include "output.h"
#include "ray_launches.h"
#include "simulation.h"

namespace raydix::cli {
namespace {

struct SimulateCommand {
    CommonOptions common;
    TreeOptions tree;
    LaunchOptions launches;
    std::string scene, machine = "gtx480", kernel = "all", rays = "all";
    int width = 32;
    bool memory = false, any_hit = false;
};

std::vector<SimulateOptions> runs_of(const SimulateCommand& options, const MachineModel& machine) {
    std::vector<SimulateOptions> runs;
    for (const WarpKernel kernel : kernels_from(options.kernel))
        runs.push_back({.kernel = kernel,
                        .machine = machine,
                        .width = options.width,
                        .any_hit = options.any_hit,
                        .memory = options.memory});
    return runs;
}

void print_head(const SimulateCommand& options, const MachineModel& m, const WarpTree& tree) {
    fmt::print(
        "machine {} (simulated): {} multiprocessors, {:g} lanes a clock each, {:g} GHz\n    {}\n",
        m.name, m.multiprocessors, m.lanes_per_clock, m.clock_ghz, m.origin);
    fmt::print("pair64 nodes and woop48 triangles{}, {} bytes, depth {}, width {}\n",
               tree.has_wide_nodes() ? ", wide nodes besides" : "", grouped(tree.bytes()),
               tree.max_depth(), options.width);
}

void run_simulate(const SimulateCommand& options) {
    const MachineModel machine = machine_from(options.machine);
    const std::vector<SimulateOptions> runs = runs_of(options, machine);
    check_machine(options.machine, runs);
    const bool from_file = options.rays.ends_with(".npy");
    const std::vector<RayKind> kinds =
        from_file ? std::vector<RayKind>{} : kinds_from(options.rays);
    refuse_build_options(options.scene, options.tree);
    refuse_device(options.tree);
    const SceneTree input = load_scene_tree(options.scene, options.tree, options.common);
    Json document = new_document("simulate");
    document["scene"] = scene_json(input.scene);
    document["load_ms"] = input.scene.load_ms;
    const std::vector<BuildMs> builds =
        is_rdx(options.scene) ? std::vector<BuildMs>{} : std::vector{input.bvh.build_ms()};
    document["build"] =
        build_json(input.bvh, tree_stats(input.bvh, stats_options(options.tree, options.common)),
                   builds, options.tree.epo_sample);
    const std::string& cameras = options.tree.cameras_file;
    document["cameras"] = cameras.empty() ? Json(nullptr) : Json(cameras);
    document["memory"] = options.memory;
    document["machines"] = Json::array({machine_model_json(machine)});
    document["simulate"] = Json::array();
    about(options.scene, [&] {
        const WarpTree tree = warp_tree_for(input.bvh, kernels_from(options.kernel));
        std::vector<Ray> rays;
        std::optional<RayLaunches> launches;  // before any table: cameras and files may be at fault
        if (from_file)
            rays = load_rays(options.rays);
        else
            launches.emplace(options.launches, input, options.common);
        if (options.common.prints_tables()) print_head(options, machine, tree);
        tell_left_out(document, input.bvh.left_out(), options.common);
        const auto hand_out = [&](const std::vector<SimulationRow>& rows) {
            for (const SimulationRow& row : rows)
                document["simulate"].push_back(simulation_json(row));
            if (options.common.prints_tables()) {
                print_simulation(rows);
                print_steps_to_scheduled(rows);
            }
        };
        if (from_file)
            return hand_out(simulate_rays(input, tree, rays, options.rays, runs, options.common));
        document["ao_radius"] = launches->ao_radius();
        for (const RayKind kind : kinds)
            hand_out(simulate_kind(input, tree, *launches, kind, runs, options.launches,
                                   options.common));
    });
    write_json(document, options.common);
}

}  // namespace

void add_simulate_command(CLI::App& app) {
    auto options = std::make_shared<SimulateCommand>();
    CLI::App* command = app.add_subcommand(
        "simulate", "Trace rays on a simulated SIMT machine; print what bounds each kernel there");
    command
        ->add_option("SCENE", options->scene, "A file, builtin:NAME?key=value&..., or a .rdx file")
        ->required();
    command
        ->add_option("--machine", options->machine,
                     fmt::format("{}, or a .json file", fmt::join(machine_model_names(), ", ")))
        ->capture_default_str();
    command
        ->add_option("--kernel", options->kernel,
                     "Kernels, separated by commas; all: those of Aila and Laine, not the cwbvh "
                     "and short_stack kernels")
        ->capture_default_str();
    command
        ->add_option(
            "--rays", options->rays,
            "primary, ao, diffuse, diffuse_shuffled, separated by commas, or all, or a (N, "
            "8) float32 .npy file")
        ->capture_default_str();
    command->add_option("--width", options->width, "Lanes of a warp")
        ->transform(whole_number(1, 128).description(""))
        ->check(CLI::IsMember({1, 2, 4, 8, 16, 32, 64, 128}))
        ->capture_default_str();
    command->add_flag("--memory", options->memory,
                      "Also a first-order memory model, as a column of its own");
    command->add_flag("--any", options->any_hit,
                      "Rays of a file end at their first hit (ao rays always do)");
    add_launch_options(*command, options->launches);
    options->tree.builder = "split";
    options->tree.max_leaf = 8;
    add_tree_options(*command, options->tree);
    offer_binary_tree(*command, options->tree);
    add_tree_figure_options(*command, options->tree);
    add_flatten_option(*command, options->common);
    add_common_options(*command, options->common);
    command->get_option("--builder")->description("Builder (default: split, without --quality)");
    command->get_option("--quality")
        ->description(
            "Picks a builder and its rounds of reinsertion: fast is apetrei, balanced is ploc and "
            "2, high is sbvh and 4 (default: none, but the builder split)");
    command->callback([options, command] {
        if (!options->rays.ends_with(".npy"))
            refuse_given(*command, {"--any"},
                         "belongs to --rays FILE.npy, not to " + options->rays);
        require_writable_json(options->common);
        run_simulate(*options);
    });
}

}  // namespace raydix::cli
