// raydix bench traversal: the tables of Aila and Laine 2009, scene by scene: every kernel and kind
// of ray on simulated machines, the published figures beside them, the paper's claims, and a sweep
// of the warp's width.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <raydix/device.h>
#include <raydix/error.h>

#include <algorithm>
#include <cctype>
#include <memory>
#include <optional>

#include "option_checks.h"
#include "output.h"
#include "published.h"
#include "ray_launches.h"
#include "simulation.h"
#include "simulation_state.h"
#include "traversal_claims.h"
#include "traversal_measured.h"
#include "traversal_ranking.h"

namespace raydix::cli {
namespace {

struct TraversalBench {
    CommonOptions common;
    TreeOptions tree;
    LaunchOptions launches;
    std::vector<std::string> scenes{"builtin:atrium", "builtin:grove"};
    std::vector<std::string> machines{"gtx285", "gtx480", "gtx680"};
    std::string kernel = "all", rays = "all";
    double sweep_sample = 0.01;  // 0: no sweep
    bool tree_of_machine = true;
    bool memory = false;
    int repeat = 10;    // timed launches on a device
    double error = -1;  // or the largest that is wanted
    std::string state_file;
};

/// All kernels on each machine; where there is a gtx285, also the two kernels for which the authors
/// wished for new instructions, on a machine that has them.
std::vector<SimulateOptions> runs_of(const TraversalBench& options,
                                     const std::vector<MachineModel>& machines) {
    std::vector<SimulateOptions> runs;
    const std::vector<WarpKernel> kernels = kernels_from(options.kernel);
    const auto has = [&](std::string_view name) {
        return std::any_of(machines.begin(), machines.end(),
                           [&](const MachineModel& m) { return m.name == name; });
    };
    for (const MachineModel& machine : machines)
        for (const WarpKernel kernel : kernels)
            runs.push_back({.kernel = kernel, .machine = machine, .memory = options.memory});
    if (has("gtx285") && !has("gtx285_enum_popc"))
        for (const WarpKernel kernel : {WarpKernel::ray_replacement, WarpKernel::work_queue})
            if (std::find(kernels.begin(), kernels.end(), kernel) != kernels.end())
                runs.push_back({.kernel = kernel,
                                .machine = machine_model("gtx285_enum_popc"),
                                .memory = options.memory});
    return runs;
}

/// The trees that the authors had: of 2009 with early splits, of their addendum of 2012 with
/// spatial splits (Stich et al. 2009).
const char* builder_of(const MachineModel& machine) {
    return machine.name == "gtx480" || machine.name == "gtx680" ? "sbvh" : "split";
}

std::string lower_case(std::string text) {
    for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return text;
}

Json published_json(const std::string& scene) {
    constexpr std::array kinds{RayKind::primary, RayKind::ao, RayKind::diffuse};
    Json rows = Json::array();
    for (const PublishedRates& rates : published_rates) {
        if (lower_case(scene).find(rates.scene) == std::string::npos) continue;
        for (std::size_t k = 0; k < kinds.size(); ++k)
            rows.push_back({{"scene", scene},
                            {"kernel", rates.kernel},
                            {"rays", ray_kind_name(kinds[k])},
                            {"machine", rates.machine},
                            {"mrays_per_s", rates.mrays_per_s[k]},
                            {"other_edition", true},
                            {"absolute", rates.scene == "sibenik"}});
    }
    return rows;
}

const SimulationRow* row_of(const Json& published, const std::vector<SimulationRow>& rows) {
    const auto row = std::find_if(rows.begin(), rows.end(), [&](const SimulationRow& r) {
        return warp_kernel_name(r.options.kernel) == published["kernel"].get<std::string>() &&
               r.rays == published["rays"].get<std::string>() &&
               r.scene == published["scene"].get<std::string>() &&
               r.options.machine.name == published["machine"].get<std::string>();
    });
    return row == rows.end() ? nullptr : &*row;
}

/// Puts the bound beside each published rate: null where nothing was simulated.
void judge_published(Json& published, const std::vector<SimulationRow>& rows) {
    for (Json& p : published) {
        const SimulationRow* row = row_of(p, rows);
        const double bound = row == nullptr ? 0.0 : row->rates().bound;
        p["mrays_per_s_bound"] = bound > 0 ? Json(bound) : Json(nullptr);
        p["above_bound"] = bound > 0 ? Json(p["mrays_per_s"].get<double>() > bound) : Json(nullptr);
        if (bound <= 0) continue;
        const SimulatedRates::Limit limit = row->tightest();
        p["mrays_per_s_tightest"] = limit.mrays_per_s;
        p["tightest_limit"] = limit.name;
    }
}

void print_published(const Json& published, const std::vector<SimulationRow>& rows) {
    if (published.empty()) return;
    fmt::print(
        "\npublished Mrays/s of another edition of the scene, measured by the authors, beside our "
        "simulated bound and the tightest of all limits\n{:<10} {:<36} {:<9} {:>9} {:>9} {:>7} "
        "{:>9} {:>7} limit\n",
        "machine", "kernel", "rays", "published", "bound", "part", "tightest", "part");
    bool above = false;
    for (const Json& p : published) {
        const SimulationRow* row = row_of(p, rows);
        const double rate = p["mrays_per_s"].get<double>();
        fmt::print("{:<10} {:<36} {:<9} {:>9.1f}", p["machine"].get<std::string>(),
                   p["kernel"].get<std::string>(), p["rays"].get<std::string>(), rate);
        if (row == nullptr || row->rates().bound <= 0) {
            fmt::print(" {:>9} {:>7}\n", "-", "-");
            continue;
        }
        const double bound = row->rates().bound;
        const SimulatedRates::Limit limit = row->tightest();
        const std::string part =
            fmt::format(" {:>9.1f} {:>6.0f}% {:>9.1f} {:>6.0f}% {}", bound, 100 * rate / bound,
                        limit.mrays_per_s, 100 * rate / limit.mrays_per_s, limit.name);
        fmt::print("{}\n", rate > bound ? warning(part + " above the bound") : part);
        above = above || rate > bound;
    }
    if (above)
        fmt::print("{}\n",
                   warning("above the bound: scene, tree or a cost of the model differs from "
                           "the authors'"));
}

/// Efficiency and bound of every kernel over the width of a warp, with the costs of the first
/// machine and as many lanes as it has.
Json sweep_widths(const TraversalBench& options, const SceneTree& input, const WarpTree& tree,
                  const MachineModel& machine) {
    Json found = Json::array();
    LaunchOptions sampled = options.launches;
    sampled.sample = std::min(sampled.sample, options.sweep_sample);
    const RayLaunches launches(sampled, input, options.common);
    std::vector<int> widths;
    for (const int width : {1, 2, 4, 8, 16, 32, 64, 128})
        if (machine.resident_lanes % static_cast<unsigned>(width) == 0) widths.push_back(width);
    std::vector<SimulateOptions> runs;
    for (const WarpKernel kernel : kernels_from(options.kernel))
        for (const int width : widths)
            runs.push_back({.kernel = kernel, .machine = machine, .width = width});
    for (const RayKind kind : kinds_from(options.rays)) {
        const std::vector<SimulationRow> rows =
            simulate_kind(input, tree, launches, kind, runs, sampled, options.common);
        if (options.common.prints_tables())
            fmt::print("\n{} rays of {}: SIMD efficiency by width ({} costs, simulated)\n{:<36}",
                       ray_kind_name(kind), input.scene.name, machine.name, "kernel");
        for (std::size_t k = 0; k < rows.size(); ++k) {
            const SimulatedRates rates = rows[k].rates();
            const bool any = rows[k].sum.instructions > 0;  // else there is nothing to rate
            found.push_back({{"scene", rows[k].scene},
                             {"kernel", warp_kernel_name(rows[k].options.kernel)},
                             {"rays", rows[k].rays},
                             {"machine", machine.name},
                             {"width", rows[k].options.width},
                             {"simd_efficiency", any ? Json(rates.simd_efficiency) : Json(nullptr)},
                             {"mrays_per_s_bound", any ? Json(rates.bound) : Json(nullptr)},
                             {"sample", sampled.sample},
                             {"simulated", true}});
            if (!options.common.prints_tables()) continue;
            if (k == 0)
                for (const int width : widths) fmt::print(" {:>7}", width);
            if (rows[k].options.width == 1)
                fmt::print("\n{:<36}", warp_kernel_name(rows[k].options.kernel));
            fmt::print(" {:>7}", any ? fmt::format("{:.1f}%", 100 * rates.simd_efficiency) : "-");
        }
        if (options.common.prints_tables()) fmt::print("\n");
    }
    return found;
}

void print_by_machine(const std::vector<SimulationRow>& rows) {
    std::vector<SimulationRow> group;
    for (const SimulationRow& row : rows) {
        if (!group.empty() && group.front().options.machine.name != row.options.machine.name) {
            print_simulation(group);
            print_steps_to_scheduled(group);
            group.clear();
        }
        group.push_back(row);
    }
    print_simulation(group);
    print_steps_to_scheduled(group);
}

class TraversalStudy {
public:
    explicit TraversalStudy(const TraversalBench& options)
        : options_(options), document_(new_document("bench traversal")) {
        if (!options.state_file.empty()) state_.emplace(options.state_file);
        for (const char* list : {"scenes", "builds", "machines", "simulate", "measured",
                                 "published", "claims", "ranking", "width_sweep"})
            document_[list] = Json::array();
        const std::string& cameras = options.tree.cameras_file;
        document_["cameras"] = cameras.empty() ? Json(nullptr) : Json(cameras);
        document_["memory"] = options.memory;
        document_["error"] = options.error >= 0 ? Json(options.error) : Json(nullptr);
        document_["sweep_sample"] = options.sweep_sample;
        document_["repeat"] = options.repeat;
        require_different_names(options.scenes);
        if (on_device()) static_cast<void>(device_name());  // says what is missing, before any work
        for (const std::string& name : options.machines) {
            add_machine(name);
            check_machine(name, runs_of(options, {machines_.back()}));
        }
        runs_ = runs_of(options, machines_);
        std::vector<std::string> named;
        for (const SimulateOptions& run : runs_) {
            if (std::find(named.begin(), named.end(), run.machine.name) != named.end()) continue;
            named.push_back(run.machine.name);
            document_["machines"].push_back(machine_model_json(run.machine));
        }
    }

    void run() {
        for (const std::string& scene : options_.scenes) about(scene, [&] { study(scene); });
        document_["claims"] = traversal_claims(rows_);
        document_["ranking"] = traversal_ranking(rows_);
        judge_published(document_["published"], rows_);
        if (options_.common.prints_tables()) {
            print_published(document_["published"], rows_);
            print_claims(document_["claims"]);
            print_ranking(document_["ranking"]);
            print_measured(document_["measured"]);
            if (!on_device())
                fmt::print("\nmeasured: no GPU was used; every rate above is simulated\n");
        }
        write_json(document_, options_.common);
    }

private:
    [[nodiscard]] bool on_device() const { return runs_on_device(options_.tree.device); }

    /// Throws InputError if its name is that of an earlier one: rows have no more than the name.
    void add_machine(const std::string& name_or_file) {
        machines_.push_back(machine_from(name_or_file));
        const std::string& name = machines_.back().name;
        if (std::ranges::count(machines_, name, &MachineModel::name) > 1)
            throw InputError(
                fmt::format("{}: an earlier machine is named '{}', too: results "
                            "would not tell them apart",
                            name_or_file, name));
    }

    /// The same tree, cameras and launches as are simulated, all of them.
    void measure(const SceneTree& input, const WarpTree& tree, RayKind kind,
                 const std::vector<SimulationRow>& rows) {
        LaunchOptions whole = options_.launches;
        whole.sample = 1.0;
        const std::size_t first = document_["measured"].size();
        const RayLaunches launches(whole, input, options_.common);
        for (const Json& row :
             measure_kind(input.scene.name, std::string(builder_name(input.bvh.options().builder)),
                          tree, launches, kind, rows,
                          {.kernels = kernels_from(options_.kernel), .repeat = options_.repeat}))
            document_["measured"].push_back(row);
        const Json asked = asked_launches_json(input, launches, kind, whole);
        for (std::size_t k = first; k < document_["measured"].size(); ++k)
            document_["measured"][k].update(asked);
    }

    void study(const std::string& name) {
        refuse_build_options(name, options_.tree);
        std::vector<std::string> builders;
        for (const SimulateOptions& run : runs_)
            if (std::find(builders.begin(), builders.end(), tree_of(name, run.machine)) ==
                builders.end())
                builders.push_back(tree_of(name, run.machine));
        for (const std::string& builder : builders) study(name, builder);
        for (const Json& row : published_json(document_["scenes"].back()["name"]))
            document_["published"].push_back(row);
    }

    /// The builder for a machine's rows; that of the command line if it names one, and of no
    /// meaning for a tree from a file.
    std::string tree_of(const std::string& scene, const MachineModel& machine) const {
        return options_.tree_of_machine && !is_rdx(scene) ? builder_of(machine)
                                                          : options_.tree.builder;
    }

    void study(const std::string& name, const std::string& builder) {
        TreeOptions tree_options = options_.tree;
        tree_options.builder = builder;
        tree_options.device = "cpu";  // trees come from the host, whoever walks them
        std::vector<SimulateOptions> runs;
        for (const SimulateOptions& run : runs_)
            if (tree_of(name, run.machine) == builder) runs.push_back(run);
        const SceneTree input = load_scene_tree(name, tree_options, options_.common);
        const std::string& scene = input.scene.name;
        const std::vector<BuildMs> builds =
            is_rdx(name) ? std::vector<BuildMs>{} : std::vector{input.bvh.build_ms()};
        const TreeStats stats = tree_stats(input.bvh, stats_options(tree_options, options_.common));
        const Json scene_fields = scene_json(input.scene);
        if (document_["scenes"].empty() || document_["scenes"].back() != scene_fields)
            document_["scenes"].push_back(scene_fields);
        document_["builds"].push_back(
            build_json(input.bvh, stats, builds, tree_options.epo_sample));
        const WarpTree tree = warp_tree_for(input.bvh, kernels_from(options_.kernel));
        const RayLaunches launches(options_.launches, input, options_.common);
        if (options_.common.prints_tables())
            fmt::print("\n{}: {} triangles, builder {}, {} nodes, SAH {}, depth {}\n", scene,
                       grouped(input.scene.mesh().triangles.size()),
                       builder_name(input.bvh.options().builder), grouped(stats.nodes),
                       stats.sah ? fmt::format("{:.1f}", *stats.sah) : "-", stats.max_depth);
        for (const RayKind kind : kinds_from(options_.rays)) {
            const std::vector<SimulationRow> rows =
                simulate_kind(input, tree, launches, kind, runs, options_.launches, options_.common,
                              {options_.error, state_ ? &*state_ : nullptr});
            for (const SimulationRow& row : rows) {
                document_["simulate"].push_back(simulation_json(row));
                rows_.push_back(row);
            }
            if (options_.common.prints_tables()) print_by_machine(rows);
            if (on_device()) measure(input, tree, kind, rows);
        }
        // The sweep has the costs of the first machine, and its tree.
        if (options_.sweep_sample <= 0 || runs.front().machine.name != machines_.front().name)
            return;
        for (const Json& row : sweep_widths(options_, input, tree, machines_.front()))
            document_["width_sweep"].push_back(row);
    }

    const TraversalBench& options_;
    Json document_;
    std::optional<SimulationState> state_;
    std::vector<MachineModel> machines_;
    std::vector<SimulateOptions> runs_;
    std::vector<SimulationRow> rows_;
};

}  // namespace

void add_traversal_suite(CLI::App& bench) {
    auto options = std::make_shared<TraversalBench>();
    CLI::App* command = bench.add_subcommand(
        "traversal",
        "Kernels of Aila and Laine 2009 on simulated machines, beside what they published");
    command->add_option("SCENE", options->scenes, "Scenes to study")->capture_default_str();
    command
        ->add_option("--machine", options->machines,
                     fmt::format("Any of {}, or .json files, separated by commas",
                                 fmt::join(machine_model_names(), ", ")))
        ->delimiter(',')
        ->allow_extra_args(false)
        ->capture_default_str();
    command
        ->add_option("--kernel", options->kernel,
                     "Kernels, separated by commas; all: those of Aila and Laine, not the cwbvh "
                     "and short_stack kernels")
        ->capture_default_str();
    command
        ->add_option("--rays", options->rays,
                     "primary, ao, diffuse, diffuse_shuffled, separated by commas, or all")
        ->capture_default_str();
    command
        ->add_option("--sweep-sample", options->sweep_sample,
                     "Part of the rays for the sweep of the width from 1 to 128; 0: no sweep")
        ->check(number_up_to(1, true))
        ->capture_default_str();
    command->add_flag("--memory", options->memory,
                      "Also a first-order memory model, as a column of its own");
    command
        ->add_option("--repeat", options->repeat,
                     "Timed launches with --device cuda, opencl or hip")
        ->transform(whole_number(1, 1000))
        ->capture_default_str();
    CLI::Option* const error =
        command
            ->add_option("--error", options->error,
                         "Ends a kind of rays when no sampling error is larger, 0.02 for 2 %; "
                         "packet and while_while trace all launches first, for a correction")
            ->check(number_up_to(1, false));
    command
        ->add_option("--state", options->state_file,
                     "Keeps what has been counted in this file after each launch, and goes on "
                     "with what it holds")
        ->check(file_name());
    add_launch_options(*command, options->launches);
    error->excludes(command->get_option("--sample"));  // of the rest nothing would be known
    options->tree.builder = "split";
    options->tree.max_leaf = 8;
    add_tree_options(*command, options->tree);
    offer_binary_tree(*command, options->tree, "cpu|cuda|opencl[:N]|hip[:N]");
    add_tree_figure_options(*command, options->tree);
    add_common_options(*command, options->common);
    command->get_option("--builder")
        ->description(
            "Builder (default, without --quality: sbvh for gtx480 and gtx680, else split)");
    command->get_option("--quality")
        ->description(
            "Picks a builder and its rounds of reinsertion: fast is apetrei, balanced is ploc and "
            "2, high is sbvh and 4 (default: none, but the builder of each machine)");
    command->callback([options, command] {
        options->tree_of_machine = command->get_option("--builder")->count() == 0 &&
                                   command->get_option("--quality")->count() == 0;
        TreeOptions host_tree = options->tree;
        if (is_device(host_tree.device)) host_tree.device = "cpu";
        refuse_device(host_tree);
        require_writable_json(options->common);
        TraversalStudy(*options).run();
    });
}

}  // namespace raydix::cli
