// raydix bench hierarchy: the builders of the LBVH family beside each other, measured here and
// predicted for larger machines (Karras 2012, section 5).
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <raydix/error.h>
#include <raydix/hierarchy_study.h>
#include <raydix/machine.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>

#include "output.h"

namespace raydix::cli {
namespace {

struct HierarchyBench {
    CommonOptions common;
    std::vector<std::string> scenes{"builtin:figure?triangles=174000",
                                    "builtin:figure?triangles=1770000"};
    std::vector<std::uint64_t> sizes{1000, 10'000, 100'000, 1'000'000};
    std::vector<int> thread_counts;
    std::vector<std::string> builders{"karras", "apetrei", "garanzha", "lauterbach"};
    std::vector<double> factors{1, 2, 4, 8, 16, 32, 64};
    std::vector<int> bits{30};
    int max_leaf = 1, repeat = 3;
};

/// A builder and the way it fits boxes: what one column of the tables is.
struct Variant {
    Builder builder;
    Fit fit;
    [[nodiscard]] std::string name() const {
        return std::string(builder_name(builder)) + (fit == Fit::levels ? "+levels" : "+atomic");
    }
};

std::vector<Variant> variants_of(const std::vector<std::string>& builders) {
    std::vector<Variant> all;
    for (const std::string& name : builders)
        for (const Fit fit : {Fit::atomic, Fit::levels})
            all.push_back({builder_from_name(name), fit});
    return all;
}

Json launches_json(const HierarchyRun& run) {
    Json launches = Json::array();
    for (const LaunchFigures& l : run.launches)
        launches.push_back({{"label", l.label},
                            {"items", l.items},
                            {"bytes", l.bytes},
                            {"steps", l.steps},
                            {"longest_chain", l.longest_chain},
                            {"ms", l.ms}});
    return launches;
}

std::uint64_t sum_of(const HierarchyRun& run, std::uint64_t LaunchFigures::*member) {
    std::uint64_t sum = 0;
    for (const LaunchFigures& l : run.launches) sum += l.*member;
    return sum;
}

Json machine_json(const LaunchMachine& m) {
    return {{"name", m.name},
            {"lanes", m.lanes},
            {"item_ns", m.item_ns},
            {"step_ns", m.step_ns},
            {"bytes_per_ns", m.bytes_per_ns},
            {"latency_ns", m.latency_ns},
            {"launch_us", m.launch_us},
            {"origin", m.origin}};
}

/// Predictions for each machine and factor, in the order of `factors`.
Json predictions_json(const HierarchyRun& run, const std::vector<LaunchMachine>& machines,
                      const std::vector<double>& factors) {
    Json all = Json::object();
    for (const LaunchMachine& machine : machines) {
        Json row = Json::array();
        for (const double factor : factors) row.push_back(predicted_ms(run, machine, factor));
        all[machine.name] = row;
    }
    return all;
}

class Study {
public:
    Study(const HierarchyBench& options, Json& document) : options_(options), document_(document) {}

    void run() {
        machines_ = study_machines();
        document_["max_leaf"] = options_.max_leaf;
        document_["factors"] = options_.factors;
        document_["runs"] = Json::array();
        document_["builds"] = Json::array();
        thread_counts_ = options_.thread_counts;
        if (thread_counts_.empty())
            for (int t = 1; t <= machine_info().cores; t *= 2) thread_counts_.push_back(t);
        for (const int threads : thread_counts_) here_[threads] = measure_this_machine(threads);
        Json machines = Json::array();
        for (const LaunchMachine& m : machines_) machines.push_back(machine_json(m));
        for (const auto& [threads, m] : here_) {
            Json one = machine_json(m);
            one["threads"] = threads;
            machines.push_back(one);
        }
        document_["machines"] = machines;
        if (options_.common.prints_tables()) print_machines();
        for (const int bits : options_.bits) {
            for (const std::string& name : options_.scenes) {
                const Model scene = load_flat_model(name, options_.common.seed);
                study(scene, bits, false);
                about(scene.name, [&] { time_builds(scene, bits); });
            }
            for (const std::uint64_t n : options_.sizes)
                study(load_flat_model(fmt::format("builtin:soup?triangles={}", n),
                                      options_.common.seed),
                      bits, true);
        }
    }

private:
    void print_machines() const {
        const auto print = [](const std::string& name, const LaunchMachine& m) {
            fmt::print(
                "{:<20} {:>7.0f} lanes, {:.2f} ns an item, {:.2f} ns a step, {:.0f} GB/s, {:.0f} "
                "ns latency, "
                "{:.1f} us a launch\n    {}\n",
                name, m.lanes, m.item_ns, m.step_ns, m.bytes_per_ns, m.latency_ns, m.launch_us,
                m.origin);
        };
        for (const LaunchMachine& m : machines_) print(m.name + " (simulated)", m);
        for (const auto& [threads, m] : here_) print(fmt::format("here, {} threads", threads), m);
    }

    void print_head(const std::string& scene, std::uint32_t keys, int bits) const {
        fmt::print(
            "\n{}, {} keys, {} bits: hierarchy and boxes\n{:<18} {:>8} {:>7} {:>9} {:>9} {:>7} "
            "{:>9}",
            scene, grouped(keys), bits, "builder+fit", "launches", "chain", "MB", "items/M",
            "threads", "here ms");
        fmt::print(" {:>9} {:>7}", "predicted", "error");
        for (const LaunchMachine& m : machines_)
            fmt::print(" | {:>9} {:>9} {:>6}", m.name,
                       fmt::format("x{:g}", options_.factors.back()), "speed");
        fmt::print("\n");
    }

    void print_row(const Variant& variant, const HierarchyRun& run, int threads) const {
        std::uint64_t chain = 0;
        for (const LaunchFigures& l : run.launches) chain += l.longest_chain;
        const double predicted = predicted_ms(run, here_.at(threads)), measured = run.measured_ms();
        fmt::print("{:<18} {:>8} {:>7} {:>9.1f} {:>9.2f} {:>7} {:>9.3f} {:>9.3f} {:>+6.0f}%",
                   variant.name(), run.launches.size(), chain,
                   double(sum_of(run, &LaunchFigures::bytes)) / 1e6,
                   double(sum_of(run, &LaunchFigures::items)) / 1e6, threads, measured, predicted,
                   100 * (predicted / measured - 1));
        for (const LaunchMachine& m : machines_) {
            const double once = predicted_ms(run, m, options_.factors.front()),
                         most = predicted_ms(run, m, options_.factors.back());
            fmt::print(" | {:>9.3f} {:>9.3f} {:>5.1f}x", once, most, once / most);
        }
        fmt::print("\n");
    }

    void study(const Model& scene, int bits, bool size_series) {
        bool headed = false;
        std::vector<std::uint64_t> levels;
        for (const Variant& variant : variants_of(options_.builders)) {
            for (const int threads : thread_counts_) {
                const BuildOptions build{.builder = variant.builder,
                                         .bits = bits,
                                         .max_leaf = options_.max_leaf,
                                         .fit = variant.fit,
                                         .threads = threads};
                const HierarchyRun run = about(scene.name, [&] {
                    return study_hierarchy(scene.mesh(), build, options_.repeat);
                });
                note(scene, variant, run, threads, size_series);
                if (variant.builder == Builder::garanzha) levels = run.items_per_level;
                if (!options_.common.prints_tables()) continue;
                if (!headed) print_head(scene.name, run.keys, bits);
                headed = true;
                if (run.refusal.empty())
                    print_row(variant, run, threads);
                else
                    fmt::print("{:<18} refused: {}\n", variant.name(), run.refusal);
            }
        }
        if (headed && !levels.empty()) fmt::print("nodes a level: {}\n", fmt::join(levels, " "));
    }

    /// Whole builds into kept memory, stage by stage: what a user of each builder gets here.
    void time_builds(const Model& scene, int bits) {
        constexpr std::array<std::pair<const char*, double BuildMs::*>, 7> stages{
            {{"bounds", &BuildMs::bounds},
             {"codes", &BuildMs::codes},
             {"sort", &BuildMs::sort},
             {"hierarchy", &BuildMs::hierarchy},
             {"layout", &BuildMs::layout},
             {"fit", &BuildMs::fit},
             {"total", &BuildMs::total}}};
        bool headed = false;
        for (const std::string& name : options_.builders) {
            for (const int threads : thread_counts_) {
                const BuildOptions build{.builder = builder_from_name(name),
                                         .bits = bits,
                                         .max_leaf = options_.max_leaf,
                                         .threads = threads};
                const std::vector<BuildMs> times = rebuilds(scene.mesh(), build);
                Json entry{{"scene", scene.name},
                           {"builder", name},
                           {"bits", bits},
                           {"threads", threads},
                           {"ms", Json::object()}};
                if (!headed && options_.common.prints_tables()) print_stages_head(scene.name, bits);
                headed = true;
                if (options_.common.prints_tables()) fmt::print("{:<18} {:>8}", name, threads);
                for (const auto& [stage, member] : stages) {
                    std::vector<double> values;
                    for (const BuildMs& ms : times) values.push_back(ms.*member);
                    entry["ms"][stage] =
                        times.empty() ? Json(nullptr) : spread_json(spread_of(values));
                    if (options_.common.prints_tables())
                        fmt::print(" {:>9.2f}", times.empty() ? NAN : spread_of(values).median);
                }
                if (options_.common.prints_tables()) fmt::print("\n");
                document_["builds"].push_back(entry);
            }
        }
    }
    static void print_stages_head(const std::string& scene, int bits) {
        fmt::print("\n{}, {} bits: whole builds into kept memory, ms\n{:<18} {:>8}", scene, bits,
                   "builder", "threads");
        for (const char* stage : {"bounds", "codes", "sort", "hierarchy", "layout", "fit", "total"})
            fmt::print(" {:>9}", stage);
        fmt::print("\n");
    }
    /// After one to warm up. Empty if the builder refuses.
    [[nodiscard]] std::vector<BuildMs> rebuilds(const Mesh& mesh, const BuildOptions& build) const {
        BvhBuilder builder;
        Bvh tree;
        std::vector<BuildMs> times;
        try {
            builder.build(mesh, build, tree);
            for (int k = 0; k < options_.repeat; ++k) {
                builder.build(mesh, build, tree);
                times.push_back(tree.build_ms());
            }
        } catch (const InputError&) {  // more memory than it may take; the launches say why
        }
        return times;
    }

    void note(const Model& scene, const Variant& variant, const HierarchyRun& run, int threads,
              bool size_series) {
        Json entry{{"scene", scene.name},
                   {"series", size_series ? "size" : "scene"},
                   {"keys", run.keys},
                   {"bits", run.bits},
                   {"builder", builder_name(variant.builder)},
                   {"fit", variant.fit == Fit::levels ? "levels" : "atomic"},
                   {"threads", threads}};
        if (!run.refusal.empty()) {
            entry["refusal"] = run.refusal;
        } else {
            entry["inner_nodes"] = run.inner_nodes;
            entry["max_depth"] = run.max_depth;
            entry["measured_ms"] = run.measured_ms();
            entry["predicted_ms"] = predicted_ms(run, here_.at(threads));
            entry["simulated_ms"] = predictions_json(run, machines_, options_.factors);
            entry["items_per_level"] = run.items_per_level;
            entry["launches"] = launches_json(run);
        }
        document_["runs"].push_back(entry);
    }

    const HierarchyBench& options_;
    Json& document_;
    std::vector<LaunchMachine> machines_;
    std::vector<int> thread_counts_;
    std::map<int, LaunchMachine> here_;
};

void run_hierarchy(const HierarchyBench& options) {
    Json document = new_document("bench hierarchy");
    Study(options, document).run();
    write_json(document, options.common);
}

}  // namespace

void add_bench_command(CLI::App& app) {
    CLI::App* bench = app.add_subcommand("bench", "Measure one question and print its tables");
    bench->require_subcommand(1);
    add_traversal_suite(*bench);
    add_cpu_suite(*bench);
    add_scene_suite(*bench);
    add_points_suite(*bench);
    auto options = std::make_shared<HierarchyBench>();
    CLI::App* command = bench->add_subcommand(
        "hierarchy",
        "Builders of the LBVH family: launches, times here, times of simulated larger machines");
    command->add_option("SCENE", options->scenes, "Scenes to study")->capture_default_str();
    command->add_option("--sizes", options->sizes, "Triangles of a soup, for times over sizes")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->check(CLI::Range(1, 100'000'000))
        ->capture_default_str();
    command
        ->add_option("--thread-counts", options->thread_counts,
                     "Threads to measure with (default: 1, 2, 4, ...)")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->check(CLI::Range(1, 1024));
    command->add_option("--builders", options->builders, "Builders to study")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->check(CLI::IsMember({"karras", "apetrei", "garanzha", "lauterbach"}))
        ->capture_default_str();
    command
        ->add_option("--factors", options->factors, "Sizes of the simulated machines, in multiples")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->check(finite_number(false))
        ->capture_default_str();
    command->add_option("--bits", options->bits, "Bits of the Morton codes")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->check(CLI::IsMember({30, 63}))
        ->capture_default_str();
    command->add_option("--max-leaf", options->max_leaf, "Most primitives in a leaf")
        ->check(CLI::Range(1, 255))
        ->capture_default_str();
    command->add_option("--repeat", options->repeat, "Timed runs after a warm-up")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    add_common_options(*command, options->common);
    command->callback([options] { run_hierarchy(*options); });
}

}  // namespace raydix::cli
