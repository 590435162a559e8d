// The claims of Karras 2012 as data. One rule for all: a claim is a figure and the range it must
// lie in. What is counted has no error. What is modelled has an interval: the figure times 1 - e to
// 1 + e, where e is the largest error of the rows it stands on, and 0.5 on machines whose constants
// are estimates. Holds: the whole interval lies in the range. Does not hold: none of it.
// Else open.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <set>

#include "hierarchy_bench.h"

namespace raydix::cli {
namespace {

constexpr double any = std::numeric_limits<double>::infinity(), estimated = 0.5;

struct Judged {
    std::string claim, paper, scene, machine, figure;
    double value, error, low, high;
};

const char* verdict_of(const Judged& j) {
    if (!std::isfinite(j.value)) return "open";
    const double from = j.value * (1 - j.error), to = j.value * (1 + j.error);
    if (from >= j.low && to <= j.high) return "holds";
    return to < j.low || from > j.high ? "does not hold" : "open";
}

Json json_of(const Judged& j) {
    return {{"claim", j.claim},
            {"paper", j.paper},
            {"scene", j.scene},
            {"machine", j.machine},
            {"figure", j.figure},
            {"value", finite(j.value)},
            {"error", finite(std::isfinite(j.value) ? j.error : j.value)},
            {"low", finite(j.low)},
            {"high", finite(j.high)},
            {"verdict", verdict_of(j)}};
}

/// The rows of one scene, with as many threads as the first has.
class SceneRuns {
public:
    SceneRuns(const std::vector<StudiedRow>& rows, std::string name) : name_(std::move(name)) {
        for (const StudiedRow& row : rows)
            if (row.scene == name_ && !row.size_series && row.run.refusal.empty() &&
                row.run.keys > 1 && row.run.threads == rows.front().run.threads)
                runs_.push_back(&row.run);
    }
    [[nodiscard]] const std::string& name() const { return name_; }
    [[nodiscard]] const std::vector<const HierarchyRun*>& runs() const { return runs_; }
    [[nodiscard]] const HierarchyRun* find(const StudyCase& what) const {
        const auto found = std::ranges::find_if(
            runs_, [&](const HierarchyRun* run) { return run->what.name() == what.name(); });
        return found == runs_.end() ? nullptr : *found;
    }

private:
    std::string name_;
    std::vector<const HierarchyRun*> runs_;
};

const StudyCase own{"karras", StudyForm::published, Fit::atomic};
const StudyCase by_levels{"garanzha", StudyForm::published, Fit::levels};
const StudyCase one_pass{"karras", StudyForm::launches, Fit::atomic};
const StudyCase pass_a_level{"karras", StudyForm::launches, Fit::levels};

/// A machine of any size, as the claims need it.
struct Machine {
    std::string name;
    double own_error;  // NaN: that of the rows
    std::function<double(const HierarchyRun&, double)> ms;
};

std::vector<Machine> machines_of(const MeasuredCosts& costs) {
    std::vector<Machine> all{{"here", std::nan(""), [&](const HierarchyRun& run, double factor) {
                                  return predicted_ms(run, costs, factor);
                              }}};
    for (const LaunchMachine& machine : study_machines())
        all.push_back({machine.name, estimated, [machine](const HierarchyRun& run, double factor) {
                           return predicted_ms(run, machine, factor);
                       }});
    return all;
}

double error_of(const Machine& machine, const MeasuredCosts& costs,
                std::initializer_list<const HierarchyRun*> runs) {
    if (std::isfinite(machine.own_error)) return machine.own_error;
    double worst = 0;
    for (const HierarchyRun* run : runs) {
        const double error =
            std::fabs(predicted_ms(*run, costs, run->threads) / run->measured_ms() - 1);
        if (!std::isfinite(error)) return error;
        worst = std::max(worst, error);
    }
    return worst;
}

/// A run with only those launches whose name begins so.
HierarchyRun part_of(const HierarchyRun& run, std::string_view prefix) {
    HierarchyRun part = run;
    std::erase_if(part.launches,
                  [&](const LaunchFigures& l) { return !l.label.starts_with(prefix); });
    return part;
}

void same_tree(const SceneRuns& scene, Json& out) {
    std::set<std::string> digests;
    std::size_t builds = 0;
    for (const HierarchyRun* run : scene.runs())
        if (!run->digest.empty()) {
            digests.insert(run->digest);
            ++builds;
        }
    if (builds < 2) return;
    out.push_back(json_of({"1. the same tree as the level-by-level builder", "asserted",
                           scene.name(), "any", fmt::format("different trees of {} builds", builds),
                           static_cast<double>(digests.size()), 0, 1, 1}));
}

void scaling(const SceneRuns& scene, const MeasuredCosts& costs, Json& out) {
    const HierarchyRun *ours = scene.find(own), *levels = scene.find(by_levels);
    if (ours == nullptr || levels == nullptr) return;
    for (const Machine& machine : machines_of(costs)) {
        const double error = error_of(machine, costs, {ours, levels});
        const auto gain = [&](const HierarchyRun& run) {
            return machine.ms(run, 1) / machine.ms(run, 64);
        };
        out.push_back(json_of({"2. level by level goes sub-linear", "shown in a plot", scene.name(),
                               machine.name, "garanzha as published: speed-up at N = 64, over 64",
                               gain(*levels) / 64, error, 0, 0.5}));
        out.push_back(
            json_of({"2. the parallel builder keeps scaling", "shown in a plot", scene.name(),
                     machine.name, "karras as published: speed-up at N = 64, over that of garanzha",
                     gain(*ours) / gain(*levels), error, 1.0, any}));
    }
}

/// Over soups of growing size: work for a key must not grow.
void linear_work(const std::vector<StudiedRow>& rows, Json& out) {
    const HierarchyRun *least = nullptr, *most = nullptr;
    for (const StudiedRow& row : rows) {
        if (!row.size_series || row.run.what.name() != own.name() || row.run.keys < 2) continue;
        if (least == nullptr || row.run.keys < least->keys) least = &row.run;
        if (most == nullptr || row.run.keys > most->keys) most = &row.run;
    }
    if (least == nullptr || least->keys == most->keys) return;
    const auto per_key = [](const HierarchyRun& run) {
        double work = 0;
        for (const LaunchFigures& l : run.launches) work += double(l.items) + double(l.steps);
        return work / run.keys;
    };
    out.push_back(json_of(
        {"3. work close to linear in n", "n log h at worst, near n in practice", "soups", "any",
         fmt::format("items and steps a key, {} keys over {}", most->keys, least->keys),
         per_key(*most) / per_key(*least), 0, 0, 1.25}));
    out.push_back(json_of({"3. in place", "no queue, no compaction", "soups", "any",
                           "launches of the hierarchy, whatever n is",
                           double(part_of(*most, "karras.").launches.size()), 0, 1, 1}));
}

void boxes(const SceneRuns& scene, const MeasuredCosts& costs, Json& out) {
    const HierarchyRun *pass = scene.find(one_pass), *levels = scene.find(pass_a_level);
    if (pass == nullptr || levels == nullptr) return;
    const HierarchyRun pass_boxes = part_of(*pass, "fit."), level_boxes = part_of(*levels, "fit.");
    const char* paper = "asserted: neither the levels nor their nodes are known";
    out.push_back(json_of({"4. boxes in one pass beat a launch a level", paper, scene.name(),
                           "here, measured", "time by levels, over that in one pass",
                           level_boxes.measured_ms() / pass_boxes.measured_ms(), 0, 1, any}));
    for (const Machine& machine : machines_of(costs))
        out.push_back(json_of({"4. boxes in one pass beat a launch a level", paper, scene.name(),
                               machine.name + ", N = 64", "time by levels, over that in one pass",
                               machine.ms(level_boxes, 64) / machine.ms(pass_boxes, 64),
                               error_of(machine, costs, {&pass_boxes, &level_boxes}), 1, any}));
}

/// Another scene of the same size: the published figure over ours must be about 1.
void turbine_blade(const SceneRuns& scene, Json& out) {
    const HierarchyRun* run = scene.find(own);
    if (run == nullptr || std::fabs(run->keys / 1.77e6 - 1) > 0.05) return;
    const LaunchMachine machine = study_machines().front();
    const std::pair<const char*, double> published[] = {{"karras.", 1.28}, {"fit.", 2.10}};
    for (const auto& [prefix, ms] : published)
        out.push_back(
            json_of({fmt::format("5. Turbine Blade: {} ms for {}", ms,
                                 prefix[0] == 'k' ? "the hierarchy" : "the boxes"),
                     "measured on a GTX 480; second hand, another scene of 1.77 M triangles",
                     scene.name(), machine.name, "our simulated time over the published one",
                     predicted_ms(part_of(*run, prefix), machine) / ms, estimated, 0.8, 1.25}));
}

}  // namespace

Json hierarchy_claims(const std::vector<StudiedRow>& rows, const MeasuredCosts& costs, int bits) {
    std::vector<std::string> scenes;
    for (const StudiedRow& row : rows)
        if (!row.size_series && std::ranges::find(scenes, row.scene) == scenes.end())
            scenes.push_back(row.scene);
    Json claims = Json::array();
    for (const std::string& name : scenes) {
        const SceneRuns scene(rows, name);
        same_tree(scene, claims);
        scaling(scene, costs, claims);
        boxes(scene, costs, claims);
        turbine_blade(scene, claims);
    }
    linear_work(rows, claims);
    for (Json& claim : claims) claim["bits"] = bits;
    return claims;
}

void print_hierarchy_claims(const Json& claims) {
    if (claims.empty()) return;
    fmt::print(
        "\nclaims of Karras 2012 (holds: the figure, with its error, lies in the range; does not "
        "hold: none of it does; else open)\n");
    const auto limit = [](const Json& value, const char* none) {
        return value.is_null() ? std::string(none) : fmt::format("{:g}", value.get<double>());
    };
    const auto figure = [](const Json& c) {
        if (c["value"].is_null()) return std::string("-");
        return fmt::format(
            "{:.3g} +- {} %", c["value"].get<double>(),
            c["error"].is_null() ? "-" : fmt::format("{:.0f}", 100 * c["error"].get<double>()));
    };
    for (const Json& c : claims)
        fmt::print("{:<13} {} [{}, {}, {} bits]\n              {}: {}, range {} to {}\n",
                   c["verdict"].get<std::string>(), c["claim"].get<std::string>(),
                   c["scene"].get<std::string>(), c["machine"].get<std::string>(),
                   c["bits"].get<int>(), c["figure"].get<std::string>(), figure(c),
                   limit(c["low"], "any"), limit(c["high"], "any"));
}

}  // namespace raydix::cli
