#include "report/hierarchy_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "report/html.h"
#include "report/number_text.h"
#include "report/sections.h"
#include "report/table.h"

namespace raydix::report {
namespace {

using Format = Column::Format;

StudyRun run_of(const Json& r) {
    StudyRun run{.scene = scene_name(r),
                 .builder = text_at(r, "builder"),
                 .form = text_at(r, "form"),
                 .fit = text_at(r, "fit"),
                 .refusal = text_at(r, "refusal"),
                 .size_series = text_at(r, "series") == "size",
                 .keys = number_at(r, "keys"),
                 .bits = number_at(r, "bits"),
                 .threads = number_at(r, "threads"),
                 .inner_nodes = number_at(r, "inner_nodes"),
                 .depth = number_at(r, "max_depth"),
                 .measured = number_at(r, "measured_ms"),
                 .predicted = number_at(r, "predicted_ms"),
                 .levels = numbers_at(r, "items_per_level"),
                 .launches = objects_at(r, "launches"),
                 .worst = text_at(at(r, "most_of_the_error"), "label")};
    if (const Json& machines = at(r, "simulated_ms"); machines.is_object())
        for (const auto& [machine, ms] : machines.items())
            run.simulated[machine] = numbers_at(ms, "");
    return run;
}

std::string run_table(const Study& study) {
    Table table{.title = "Every run",
                .note =
                    "\xE2\x80\x9Cpredicted\xE2\x80\x9D is what the model says for the machine "
                    "that was measured.",
                .columns = {{"case"},
                            {"scene"},
                            {"keys", Format::integer},
                            {"bits", Format::integer},
                            {"threads", Format::integer},
                            {"here", Format::number, "ms", Origin::measured},
                            {"predicted", Format::number, "ms", Origin::simulated},
                            {"error", Format::percent, "of measured"},
                            {"most of it"},
                            {"inner nodes", Format::integer},
                            {"depth", Format::integer}}};
    std::vector<std::string> machines;
    for (const StudyRun& run : study.runs)
        for (const auto& [machine, ms] : run.simulated)
            if (std::ranges::find(machines, machine) == machines.end()) machines.push_back(machine);
    for (const std::string& machine : machines) {
        const double last = study.factors.empty() ? 1 : study.factors.back();
        table.columns.push_back(
            {times_machine(machine, study.factors), Format::number, "ms", Origin::simulated});
        table.columns.push_back({machine + fmt::format(" \xC3\x97 {:g}", last), Format::number,
                                 "ms", Origin::simulated});
        table.columns.push_back({"speed-up", Format::ratio, machine, Origin::simulated});
    }
    table.columns.push_back({"refused"});
    for (const StudyRun& run : study.runs) {
        std::vector<Cell> cells{run.name(),  run.scene,       run.keys,      run.bits,
                                run.threads, run.measured,    run.predicted, run.error(),
                                run.worst,   run.inner_nodes, run.depth};
        for (const std::string& machine : machines) {
            const auto found = run.simulated.find(machine);
            const bool known = found != run.simulated.end() && !found->second.empty();
            cells.emplace_back(known ? std::optional(found->second.front()) : std::nullopt);
            cells.emplace_back(known ? std::optional(found->second.back()) : std::nullopt);
            cells.emplace_back(run.speed_up(machine));
        }
        cells.emplace_back(run.refusal);
        table.rows.push_back(cells);
    }
    table.drop_empty_columns();
    return table_html(table);
}

/// Launches of one run with the same label, added up.
struct LaunchSum {
    std::string label;
    double launches = 0, items = 0, bytes = 0, steps = 0, chain = 0, ms = 0, predicted = 0;
};

std::string launch_table(const Study& study) {
    Table table{.title = "Launches by name",
                .note =
                    "Items, bytes and steps are counted as the launches run; the time is of a run "
                    "that counts nothing.",
                .origin = Origin::measured,
                .columns = {{"launch"},
                            {"case"},
                            {"scene"},
                            {"bits", Format::integer},
                            {"threads", Format::integer},
                            {"launches", Format::integer},
                            {"items", Format::integer},
                            {"moved", Format::number, "MB"},
                            {"steps", Format::integer},
                            {"longest chain", Format::integer, "steps"},
                            {"time", Format::number, "ms"},
                            {"predicted", Format::number, "ms", Origin::simulated}}};
    for (const StudyRun& run : study.runs) {
        if (run.size_series) continue;
        std::vector<LaunchSum> sums;
        for (const Json* launch : run.launches) {
            const std::string label = text_at(*launch, "label");
            auto sum = std::ranges::find(sums, label, &LaunchSum::label);
            if (sum == sums.end()) sum = sums.insert(sums.end(), {label});
            sum->launches += number_at(*launch, "launches").value_or(1);
            sum->items += number_at(*launch, "items").value_or(0);
            sum->bytes += number_at(*launch, "bytes").value_or(0);
            sum->steps += number_at(*launch, "steps").value_or(0);
            sum->chain = std::max(sum->chain, number_at(*launch, "longest_chain").value_or(0));
            sum->ms += number_at(*launch, "ms").value_or(0);
            sum->predicted += or_nan(number_at(*launch, "predicted_ms"));
        }
        for (const LaunchSum& s : sums)
            table.rows.push_back({s.label, run.name(), run.scene, run.bits, run.threads, s.launches,
                                  s.items, s.bytes / 1e6, s.steps, s.chain, s.ms, s.predicted});
    }
    return table_html(table);
}

std::string machine_table(const Study& study) {
    Table table{.title = "Machines of the model",
                .columns = {{"machine"},
                            {"threads", Format::integer},
                            {"lanes", Format::integer},
                            {"an item", Format::number, "ns"},
                            {"a step", Format::number, "ns"},
                            {"bandwidth", Format::number, "GB/s"},
                            {"latency", Format::number, "ns"},
                            {"a launch", Format::number, "\xC2\xB5s"},
                            {"where the numbers are from"}}};
    for (const Json* m : objects_at(study.document->root, "machines"))
        table.rows.push_back({text_at(*m, "name"), number_at(*m, "threads"), number_at(*m, "lanes"),
                              number_at(*m, "item_ns"), number_at(*m, "step_ns"),
                              number_at(*m, "bytes_per_ns"), number_at(*m, "latency_ns"),
                              number_at(*m, "launch_us"), text_at(*m, "origin")});
    table.drop_empty_columns();
    return table_html(table);
}

/// What a kernel takes on the machine of the study, at the least and the largest size.
std::string cost_table(const Study& study) {
    Table table{.title = "Kernels of the model for the machine at hand",
                .note =
                    "An item or a step with one thread, on the smallest and the largest of the "
                    "inputs that kernels were measured on.",
                .origin = Origin::measured,
                .columns = {{"kernel"},
                            {"bits", Format::integer},
                            {"small", Format::number, "ns"},
                            {"large", Format::number, "ns"}}};
    for (const Json* m : objects_at(study.document->root, "machines"))
        for (const Json* kernel : objects_at(*m, "kernels")) {
            const Json& points = at(*kernel, "keys_and_ns");
            if (!points.is_array() || points.empty()) continue;
            const auto ns = [](const Json& point) -> std::optional<double> {
                const std::vector<double> pair = numbers_at(point, "");
                return pair.size() == 2 ? std::optional(pair[1]) : std::nullopt;
            };
            table.rows.push_back({text_at(*kernel, "kernel"), number_at(*m, "bits"),
                                  ns(points.front()), ns(points.back())});
        }
    return table_html(table);
}

std::string claim_table(const Study& study) {
    Table table{.title = "Claims of Karras 2012",
                .note =
                    "Holds: the figure, with its error, lies in the range. Does not hold: none "
                    "of it does. Else open. Counted figures have no error; on gtx480 and h200 "
                    "it is 50 %, because constants are estimates.",
                .columns = {{"claim"},
                            {"paper"},
                            {"scene"},
                            {"bits", Format::integer},
                            {"machine"},
                            {"figure"},
                            {"value", Format::number, ""},
                            {"error", Format::percent, ""},
                            {"from", Format::number, ""},
                            {"to", Format::number, ""},
                            {"verdict"}}};
    for (const Json* c : objects_at(study.document->root, "hierarchy_claims"))
        table.rows.push_back({text_at(*c, "claim"), text_at(*c, "paper"), scene_name(*c),
                              number_at(*c, "bits"), text_at(*c, "machine"), text_at(*c, "figure"),
                              number_at(*c, "value"), number_at(*c, "error"), number_at(*c, "low"),
                              number_at(*c, "high"), text_at(*c, "verdict")});
    return table_html(table);
}

std::string build_table(const Study& study) {
    static constexpr std::array<const char*, 7> stages{"bounds", "codes",  "sort", "hierarchy",
                                                       "fit",    "layout", "total"};
    Table table{
        .title = "Whole builds into kept memory, medians",
        .origin = Origin::measured,
        .columns = {
            {"builder"}, {"scene"}, {"bits", Format::integer}, {"threads", Format::integer}}};
    for (const char* stage : stages) table.columns.push_back({stage, Format::number, "ms"});
    for (const Json* build : objects_at(study.document->root, "builds")) {
        std::vector<Cell> cells{text_at(*build, "builder"), scene_name(*build),
                                number_at(*build, "bits"), number_at(*build, "threads")};
        for (const char* stage : stages)
            cells.emplace_back(spread_at(*build, std::string("ms.") + stage).median);
        table.rows.push_back(cells);
    }
    return table_html(table);
}

}  // namespace

std::string times_machine(const std::string& machine, const std::vector<double>& factors) {
    const double first = factors.empty() ? 1 : factors.front();
    return first == 1 ? machine : machine + fmt::format(" \xC3\x97 {:g}", first);
}

std::string StudyRun::name() const {
    std::string text = builder;
    if (form == "published" || form == "tuned") text += ", " + form;
    if (by_levels()) text += ", boxes by levels";
    if (fit == "atomic") text += ", boxes in one pass";
    return text;
}

std::optional<double> StudyRun::error() const {
    if (!measured || !predicted || *measured <= 0) return std::nullopt;
    return *predicted / *measured - 1;
}

std::optional<double> StudyRun::speed_up(const std::string& machine) const {
    const auto found = simulated.find(machine);
    if (found == simulated.end() || found->second.empty()) return std::nullopt;
    const double ratio = found->second.front() / found->second.back();
    return std::isfinite(ratio) ? std::optional(ratio) : std::nullopt;
}

std::string StudyScene::title() const {
    std::string text = scene;
    if (keys) text += ", " + with_decimals(*keys, 0) + " keys";
    if (bits) text += fmt::format(", {:.0f} bits", *bits);
    return text;
}

std::vector<std::string> StudyScene::machines() const {
    std::vector<std::string> names;
    for (const StudyRun* run : all)
        for (const auto& [machine, ms] : run->simulated)
            if (std::ranges::find(names, machine) == names.end()) names.push_back(machine);
    return names;
}

Study::Study(const Document& source)
    : document(&source), factors(numbers_at(source.root, "factors")) {
    for (const Json* run : objects_at(source.root, "runs")) runs.push_back(run_of(*run));
}

std::vector<StudyScene> Study::scenes() const {
    std::vector<StudyScene> all;
    for (const StudyRun& run : runs) {
        if (run.size_series || !run.refusal.empty()) continue;
        auto scene = std::ranges::find_if(
            all, [&](const StudyScene& s) { return s.scene == run.scene && s.bits == run.bits; });
        if (scene == all.end())
            scene = all.insert(all.end(), {run.scene, run.keys, run.bits, {}, {}});
        scene->all.push_back(&run);
        const bool seen = std::ranges::any_of(
            scene->one_each, [&](const StudyRun* other) { return other->name() == run.name(); });
        if (!seen) scene->one_each.push_back(&run);
    }
    return all;
}

std::string study_tables(const Study& study) {
    const auto folded = [](const char* title, const std::string& table) {
        return table.empty()
                   ? ""
                   : fmt::format("<details><summary>{}</summary>{}</details>\n", title, table);
    };
    constexpr std::size_t long_table = 24;
    const std::string runs = run_table(study);
    const std::string gpu = text_at(study.document->root, "gpu");
    return claim_table(study) + (gpu.empty() ? "" : "<p>GPU: " + escaped(gpu) + "</p>\n") +
           (study.runs.size() > long_table ? folded("Every run", runs) : runs) +
           folded("Launches, added up by name", launch_table(study)) +
           folded("Whole builds, every stage", build_table(study)) +
           folded("Kernels, measured", cost_table(study)) +
           folded("Machines of the model and where their numbers are from", machine_table(study));
}

}  // namespace raydix::report
