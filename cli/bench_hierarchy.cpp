// raydix bench hierarchy: the builders of the LBVH family beside each other, with the stages and
// the trees around them: counted, measured, predicted for this machine and for larger ones (Karras
// 2012, section 5), and the paper's claims.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <raydix/error.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>

#include "hierarchy_bench.h"
#include "option_checks.h"

namespace raydix::cli {
namespace {

constexpr const char* here_name = "here";

/// Launches with one name together.
Json launches_json(const HierarchyRun& run, const MeasuredCosts& costs) {
    std::vector<LaunchFigures> sums;
    std::map<std::string, std::pair<int, double>> more;  // launches, predicted milliseconds
    for (const LaunchFigures& l : run.launches) {
        auto sum = std::ranges::find(sums, l.label, &LaunchFigures::label);
        if (sum == sums.end()) sum = sums.insert(sums.end(), {l.label});
        sum->items += l.items;
        sum->bytes += l.bytes;
        sum->steps += l.steps;
        sum->longest_chain = std::max(sum->longest_chain, l.longest_chain);
        sum->ms += l.ms;
        more[l.label].first += 1;
        more[l.label].second += predicted_ms(run, l, costs);
    }
    Json launches = Json::array();
    for (const LaunchFigures& l : sums)
        launches.push_back({{"label", l.label},
                            {"launches", more[l.label].first},
                            {"items", l.items},
                            {"bytes", l.bytes},
                            {"steps", l.steps},
                            {"longest_chain", l.longest_chain},
                            {"ms", l.ms},
                            {"predicted_ms", finite(more[l.label].second)}});
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

Json costs_json(const MeasuredCosts& costs, int bits) {
    Json kernels = Json::array();
    for (const KernelCost& kernel : costs.kernels) {
        Json points = Json::array();
        for (const KernelCost::Point& point : kernel.points)
            points.push_back({point.keys, point.ns});
        kernels.push_back({{"kernel", kernel.kernel}, {"keys_and_ns", points}});
    }
    return {{"name", here_name},
            {"bits", bits},
            {"lanes", 1},
            {"latency_ns", costs.latency_ns},
            {"launch_us", costs.launch_us},
            {"origin", costs.origin},
            {"kernels", kernels}};
}

/// The kernel that the prediction misses by most, of launches with one name together; nothing where
/// there is no prediction.
struct Worst {
    std::string label;
    double measured = 0, predicted = 0;
};
std::optional<Worst> worst_of(const HierarchyRun& run, const MeasuredCosts& costs) {
    if (!std::isfinite(predicted_ms(run, costs, run.threads))) return std::nullopt;
    std::vector<Worst> sums;
    for (const LaunchFigures& l : run.launches) {
        auto sum = std::ranges::find(sums, l.label, &Worst::label);
        if (sum == sums.end()) sum = sums.insert(sums.end(), {l.label});
        sum->measured += l.ms;
        sum->predicted += predicted_ms(run, l, costs, run.threads);
    }
    const auto off = [](const Worst& w) { return std::fabs(w.predicted - w.measured); };
    if (sums.empty()) return std::nullopt;
    return *std::ranges::max_element(sums, {}, off);
}

class Study {
public:
    Study(const HierarchyBench& options, Json& document)
        : options_(options), document_(document), machines_(study_machines()) {}

    void run() {
        require_different_names(scenes());
        document_["max_leaf"] = options_.max_leaf;
        document_["repeat"] = options_.repeat;
        document_["factors"] = options_.factors;
        for (const char* list : {"runs", "builds", "machines", "hierarchy_claims"})
            document_[list] = Json::array();
        document_["gpu"] =
            "no GPU was used: rows of gtx480 and h200 are simulated, and measured "
            "ones wait for one (scripts/gpu)";
        for (const LaunchMachine& m : machines_) document_["machines"].push_back(machine_json(m));
        thread_counts_ = options_.thread_counts;
        if (thread_counts_.empty())
            for (int t = 1; t <= threads_at_work(options_.common.threads); t *= 2)
                thread_counts_.push_back(t);
        cases_ = cases();
        for (const int bits : options_.bits) study_bits(bits);
        if (options_.common.prints_tables()) {
            print_hierarchy_claims(document_["hierarchy_claims"]);
            fmt::print("\n{}\n", document_["gpu"].get<std::string>());
        }
    }

private:
    [[nodiscard]] std::vector<StudyCase> cases() const {
        std::vector<StudyCase> wanted;
        for (const StudyCase& what : study_cases())
            if (options_.subjects.empty() ||
                std::ranges::find(options_.subjects, what.subject) != options_.subjects.end())
                wanted.push_back(what);
        return wanted;
    }
    [[nodiscard]] StudyOptions study_options(int bits, int threads) const {
        return {.bits = bits,
                .max_leaf = options_.max_leaf,
                .threads = threads,
                .repeat = options_.repeat,
                .cases = cases_};
    }
    [[nodiscard]] std::vector<std::string> scenes() const {
        if (!options_.scenes.empty()) return options_.scenes;
        std::vector<std::string> names;
        for (const char* dragon : {"dragon.ply.xz", "shared/scenes/dragon/dragon.ply.xz",
                                   "../shared/scenes/dragon/dragon.ply.xz"})
            if (names.empty() && std::filesystem::exists(dragon)) names.emplace_back(dragon);
        if (names.empty() && options_.common.prints_tables())
            fmt::print("dragon.ply.xz is not in this folder; the dragon is left out\n");
        names.emplace_back("builtin:figure?triangles=174000");
        names.emplace_back("builtin:figure?triangles=1770000");
        return names;
    }

    /// All inputs of one length of codes: sheets for the costs of kernels, then what is studied.
    struct Inputs {
        std::vector<Mesh> sheets;
        std::vector<Model> models;
        std::size_t scene_count = 0;  // the first models; soups of growing size behind them
        std::vector<MeshView> views;
    };
    [[nodiscard]] Inputs inputs() const {
        Inputs in;
        for (const std::uint32_t size : options_.cost_sizes)
            in.sheets.push_back(cost_sheet(size, options_.common.seed));
        std::vector<std::string> names = scenes();
        in.scene_count = names.size();
        for (const std::uint64_t n : options_.sizes)
            names.push_back(fmt::format("builtin:soup?triangles={}", n));
        for (const std::string& name : names)
            in.models.push_back(load_flat_model(name, options_.common.seed));
        for (const Mesh& sheet : in.sheets) in.views.emplace_back(sheet);
        for (const Model& model : in.models) in.views.emplace_back(model.mesh());
        return in;
    }

    void study_bits(int bits) {
        const Inputs in = inputs();
        rows_.clear();
        // One thread first, and sheets only there: the prediction for more stands on their costs.
        const std::span<const MeshView> all = in.views;
        const auto one = study_hierarchies(all, study_options(bits, 1));
        costs_ = costs_of(std::span(one).first(in.sheets.size()));
        document_["machines"].push_back(costs_json(costs_, bits));
        if (options_.common.prints_tables()) print_machines(bits);
        std::vector<std::vector<std::vector<HierarchyRun>>> by_threads;
        for (const int threads : thread_counts_)
            by_threads.push_back(threads == 1
                                     ? std::vector(one.begin() + std::ssize(in.sheets), one.end())
                                     : study_hierarchies(all.subspan(in.sheets.size()),
                                                         study_options(bits, threads)));
        for (std::size_t m = 0; m < in.models.size(); ++m)
            for (const auto& runs : by_threads)
                note(in.models[m], m >= in.scene_count, runs[m], &runs == &by_threads.front());
        for (std::size_t m = 0; m < in.scene_count; ++m)
            for (const Json& build : whole_builds(options_, in.models[m], bits, thread_counts_))
                document_["builds"].push_back(build);
        for (const Json& claim : hierarchy_claims(rows_, costs_, bits))
            document_["hierarchy_claims"].push_back(claim);
    }

    void print_machines(int bits) const {
        for (const LaunchMachine& m : machines_)
            fmt::print(
                "{:<20} {:>7.0f} lanes, {:.2f} ns an item, {:.2f} ns a step, {:.0f} GB/s, {:.0f} "
                "ns latency, {:.1f} us a launch\n    {}\n",
                m.name + " (simulated)", m.lanes, m.item_ns, m.step_ns, m.bytes_per_ns,
                m.latency_ns, m.launch_us, m.origin);
        fmt::print(
            "{:<20} {:.0f} ns latency, {:.2f} us a launch, {} kernels with {} bits\n    {}\n",
            here_name, costs_.latency_ns, costs_.launch_us, costs_.kernels.size(), bits,
            costs_.origin);
    }

    void print_head(const std::string& scene, std::uint32_t keys, int bits) const {
        fmt::print(
            "\n{}, {} keys, {} bits\n{:<38} {:>8} {:>6} {:>8} {:>7} {:>9} {:>9} {:>6} {:<20}",
            scene, grouped(keys), bits, "case", "launches", "chain", "MB", "threads", "here ms",
            "predicted", "error", "most of it");
        for (const LaunchMachine& m : machines_)
            fmt::print(" | {:>9} {:>9} {:>6}",
                       options_.factors.front() == 1
                           ? m.name
                           : fmt::format("{} x{:g}", m.name, options_.factors.front()),
                       fmt::format("x{:g}", options_.factors.back()), "speed");
        fmt::print("\n");
    }

    void print_row(const HierarchyRun& run) const {
        std::uint64_t chain = 0;
        for (const LaunchFigures& l : run.launches) chain += l.longest_chain;
        const double predicted = predicted_ms(run, costs_, run.threads);
        const double measured = run.measured_ms(), error = predicted / measured - 1;
        const std::optional<Worst> worst = worst_of(run, costs_);
        fmt::print("{:<38} {:>8} {:>6} {:>8.1f} {:>7} {:>9.3f} {:>9} {:>6} {:<20}", run.what.name(),
                   run.launches.size(), chain, double(sum_of(run, &LaunchFigures::bytes)) / 1e6,
                   run.threads, measured, or_dash(predicted, 3),
                   std::isfinite(error) ? fmt::format("{:+.0f}%", 100 * error) : "-",
                   worst ? worst->label : "-");
        for (const LaunchMachine& m : machines_) {
            const double once = predicted_ms(run, m, options_.factors.front()),
                         most = predicted_ms(run, m, options_.factors.back());
            if (std::isfinite(once))
                fmt::print(" | {:>9.3f} {:>9.3f} {:>6}", once, most, or_dash(once / most, 1, "x"));
        }
        fmt::print("\n");
    }

    void note(const Model& scene, bool size_series, const std::vector<HierarchyRun>& runs,
              bool with_head) {
        std::vector<std::uint64_t> levels;
        const bool print = options_.common.prints_tables();
        if (print && with_head && !runs.empty())
            print_head(scene.name, runs.front().keys, runs.front().bits);
        for (const HierarchyRun& run : runs) {
            rows_.push_back({scene.name, size_series, run});
            document_["runs"].push_back(run_json(rows_.back()));
            if (run.items_per_level.size() > levels.size()) levels = run.items_per_level;
            if (print && run.refusal.empty()) print_row(run);
            if (print && !run.refusal.empty())
                fmt::print("{:<38} refused: {}\n", run.what.name(), run.refusal);
        }
        if (print && !levels.empty()) fmt::print("nodes a level: {}\n", fmt::join(levels, " "));
    }

    /// Times on machines of each size, in the order of the factors.
    [[nodiscard]] Json scaled_json(const HierarchyRun& run) const {
        Json all = Json::object();
        if (run.what.form == StudyForm::tuned) return all;
        for (const double factor : options_.factors)
            all[here_name].push_back(finite(predicted_ms(run, costs_, factor)));
        for (const LaunchMachine& machine : machines_)
            for (const double factor : options_.factors)
                all[machine.name].push_back(finite(predicted_ms(run, machine, factor)));
        return all;
    }

    [[nodiscard]] Json run_json(const StudiedRow& row) const {
        const HierarchyRun& run = row.run;
        Json entry{{"scene", row.scene},
                   {"series", row.size_series ? "size" : "scene"},
                   {"keys", run.keys},
                   {"bits", run.bits},
                   {"builder", run.what.subject},
                   {"form", study_form_name(run.what.form)},
                   {"fit", !run.what.is_builder()        ? Json(nullptr)
                           : run.what.fit == Fit::levels ? "levels"
                                                         : "atomic"},
                   {"threads", run.threads}};
        if (!run.refusal.empty()) {
            entry["refusal"] = run.refusal;
            return entry;
        }
        const double measured = run.measured_ms(),
                     predicted = predicted_ms(run, costs_, run.threads);
        entry["inner_nodes"] = run.inner_nodes;
        entry["max_depth"] = run.max_depth;
        entry["digest"] = run.digest.empty() ? Json(nullptr) : Json(run.digest);
        entry["measured_ms"] = measured;
        entry["predicted_ms"] = finite(predicted);
        entry["error"] = finite(predicted / measured - 1);
        entry["most_of_the_error"] = nullptr;
        if (const std::optional<Worst> worst = worst_of(run, costs_))
            entry["most_of_the_error"] = {{"label", worst->label},
                                          {"measured_ms", worst->measured},
                                          {"predicted_ms", worst->predicted}};
        if (run.threads != thread_counts_.front()) return entry;  // the same counts
        entry["simulated_ms"] = scaled_json(run);
        entry["items"] = sum_of(run, &LaunchFigures::items);
        entry["steps"] = sum_of(run, &LaunchFigures::steps);
        entry["bytes"] = sum_of(run, &LaunchFigures::bytes);
        if (row.size_series) return entry;
        entry["items_per_level"] = run.items_per_level;
        entry["launches"] = launches_json(run, costs_);
        return entry;
    }

    const HierarchyBench& options_;
    Json& document_;
    std::vector<LaunchMachine> machines_;
    std::vector<int> thread_counts_;
    std::vector<StudyCase> cases_;
    MeasuredCosts costs_;
    std::vector<StudiedRow> rows_;
};

void run_hierarchy(const HierarchyBench& options) {
    Json document = new_document("bench hierarchy");
    Study(options, document).run();
    write_json(document, options.common);
}

}  // namespace

void add_hierarchy_suite(CLI::App& bench) {
    auto options = std::make_shared<HierarchyBench>();
    CLI::App* command = bench.add_subcommand(
        "hierarchy",
        "Builders of the LBVH family and the stages around them: launches, times here, times of "
        "larger machines, the claims of Karras 2012");
    command->add_option("SCENE", options->scenes,
                        "Scenes to study (default: dragon.ply.xz where it is at hand, and figures "
                        "of 174 K and 1.77 M triangles)");
    command->add_option("--sizes", options->sizes, "Triangles of a soup, for times over sizes")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->transform(whole_number(1, 100'000'000))
        ->capture_default_str();
    command
        ->add_option("--cost-sizes", options->cost_sizes,
                     "Triangles of the sheets that kernels are measured on for the prediction")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->transform(whole_number(2, 100'000'000))
        ->capture_default_str();
    command
        ->add_option("--thread-counts", options->thread_counts,
                     "Threads to measure with (default: 1, 2, 4, ... up to --threads)")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->transform(whole_number(1, 1024));
    std::vector<std::string> subjects;
    for (const StudyCase& what : study_cases())
        if (subjects.empty() || subjects.back() != what.subject) subjects.push_back(what.subject);
    command
        ->add_option(
            "--builders", options->subjects,
            "What to study, of " + fmt::format("{}", fmt::join(subjects, ", ")) + " (default: all)")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->check(CLI::IsMember(subjects));
    command->add_option("--factors", options->factors, "Sizes of the larger machines, in multiples")
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
        ->transform(whole_number(1, 255))
        ->capture_default_str();
    command->add_option("--repeat", options->repeat, "Timed rounds after a warm-up")
        ->transform(whole_number(1, 1000))
        ->capture_default_str();
    add_common_options(*command, options->common);
    command->callback([options] {
        const int most = options->common.threads;  // 0: all
        for (const int threads : options->thread_counts)
            if (most > 0 && threads > most)
                throw CLI::ValidationError(
                    "--thread-counts",
                    fmt::format("{} is more than the {} of --threads", threads, most));
        require_writable_json(options->common);
        run_hierarchy(*options);
    });
}

}  // namespace raydix::cli
