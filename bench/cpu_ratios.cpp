#include "cpu_ratios.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <map>
#include <tuple>

namespace raydix::bench {
namespace {

using cli::Json;

constexpr double large_batch = 16384, small_batch_from = 64, small_batch_to = 4096;  // rays
constexpr const char* workload_groups[] = {"batches of 16 K rays and more",
                                           "batches of 64 to 4 K rays", "single calls"};

/// Else a time or a number of bytes.
bool is_rate(const std::string& figure) { return !figure.ends_with("_ms") && figure != "bytes"; }

std::vector<PeerName> peers_in(const SceneFigures& figures) {
    std::vector<PeerName> peers;
    const auto note = [&](const PeerName& name) {
        if (std::ranges::none_of(peers, [&](const PeerName& p) { return p.text == name.text; }))
            peers.push_back(name);
    };
    for (const BuildFigures& b : figures.builds) note(b.peer);
    for (const WorkloadFigures& w : figures.workloads)
        for (const ModeFigures& m : w.modes) note(m.peer);
    return peers;
}

/// Embree's trees, robust or not, that stand beside ours.
std::vector<std::string> trees_beside(const WorkloadFigures& workload, const PeerName& ours,
                                      bool robust) {
    const auto find = [&](bool any_quality) {
        std::vector<std::string> trees;
        for (const ModeFigures& m : workload.modes) {
            if (m.peer.ours() || m.peer.robust() != robust) continue;
            const std::string theirs = m.peer.quality(), own = ours.quality();
            const bool fits =
                any_quality ||
                (own == "fast" ? theirs == "low"
                               : theirs == "medium" || (own == "high" && theirs == "high"));
            if (fits && std::ranges::find(trees, m.peer.kind()) == trees.end())
                trees.push_back(m.peer.kind());
        }
        return trees;
    };
    const std::vector<std::string> trees = find(false);
    return trees.empty() ? find(true) : trees;
}

using Accept = std::function<bool(const ModeFigures&)>;

const ModeFigures* fastest(const SceneFigures& figures, const WorkloadFigures& workload,
                           const Accept& accept) {
    const ModeFigures* best = nullptr;
    for (const ModeFigures& m : workload.modes)
        if (m.threads == figures.threads && m.mrays_per_s && accept(m) &&
            (best == nullptr || m.mrays_per_s->median > best->mrays_per_s->median))
            best = &m;
    return best;
}

std::string joined(const std::vector<std::string>& words) {
    std::string text;
    for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
    return text;
}

void add_build_ratios(const SceneFigures& figures, std::vector<Ratio>& ratios) {
    const auto compared = [&](const BuildFigures& b) { return b.threads == figures.threads; };
    for (const BuildFigures& a : figures.builds)
        for (const BuildFigures& b : figures.builds) {
            if (!a.peer.ours() || b.peer.ours() || !compared(a) || !compared(b)) continue;
            const auto add = [&](const char* figure, double value) {
                ratios.push_back({a.peer.kind(), b.peer.kind(), "", figure, "", value});
            };
            add("fresh_ms", a.fresh_ms.median / b.fresh_ms.median);
            add("kept_ms", a.kept_ms.median / b.kept_ms.median);
            add("bytes", double(a.bytes.own) / double(b.bytes.own));
        }
}

/// The values of one row of the summary.
struct Values {
    SummaryRow row;
    struct Value {
        double ratio;
        std::string scene, workload;
    };
    std::vector<Value> all;

    [[nodiscard]] SummaryRow summed_up() const {
        SummaryRow out = row;
        std::vector<double> ratios;
        std::map<std::string, int> scenes;
        for (const Value& value : all) ratios.push_back(value.ratio), ++scenes[value.scene];
        const auto [least, most] =
            std::ranges::minmax_element(all, {}, [](const Value& v) { return v.ratio; });
        const Value& worst = is_rate(row.figure) ? *least : *most;
        out.median = cli::spread_of(ratios).median;
        out.worst = worst.ratio;
        out.worst_scene = worst.scene;
        out.worst_workload = worst.workload;
        out.scenes = scenes.size();
        return out;
    }
};

/// Of workload_groups, the one that a ratio also counts in; empty: none.
std::string group_of_workloads(const WorkloadFigures& workload, const Ratio& ratio) {
    const bool in_calls = workload.name.find('@') != std::string::npos;
    if (ratio.figure.starts_with("single")) return in_calls ? "" : workload_groups[2];
    const double rays = workload.rays_a_call();
    if (rays >= large_batch) return workload_groups[0];
    return rays >= small_batch_from && rays <= small_batch_to ? workload_groups[1] : "";
}

void add_value(std::vector<Values>& rows, const std::string& group, const Ratio& ratio,
               const std::string& workload, const Values::Value& value) {
    const auto same = [&](const Values& v) {
        return std::tie(v.row.group, v.row.ours, v.row.embree, v.row.workload, v.row.figure) ==
               std::tie(group, ratio.ours, ratio.embree, workload, ratio.figure);
    };
    auto row = std::ranges::find_if(rows, same);
    if (row == rows.end()) {
        Values made;
        made.row.group = group;
        made.row.ours = ratio.ours;
        made.row.embree = ratio.embree;
        made.row.workload = workload;
        made.row.figure = ratio.figure;
        row = rows.insert(rows.end(), made);
    }
    row->all.push_back(value);
}

}  // namespace

const ModeFigures* default_mode(const SceneFigures& figures, const WorkloadFigures& workload,
                                const std::string& ours, bool single) {
    return fastest(figures, workload, [&](const ModeFigures& m) {
        return m.peer.ours() && m.peer.kind() == ours && (single ? m.single : m.automatic);
    });
}

std::vector<Ratio> workload_ratios(const SceneFigures& figures, const WorkloadFigures& workload) {
    std::vector<Ratio> ratios;
    const auto add = [&](const PeerName& ours, const char* figure, bool single, bool robust) {
        const std::vector<std::string> trees = trees_beside(workload, ours, robust);
        const ModeFigures* own = default_mode(figures, workload, ours.kind(), single);
        const ModeFigures* best = fastest(figures, workload, [&](const ModeFigures& m) {
            return !m.peer.ours() && (m.single || !single) &&
                   std::ranges::find(trees, m.peer.kind()) != trees.end();
        });
        if (own != nullptr && best != nullptr)
            ratios.push_back({ours.kind(), joined(trees), workload.name, figure,
                              best->peer.kind() + ", " + best->name,
                              own->mrays_per_s->median / best->mrays_per_s->median});
    };
    for (const PeerName& peer : peers_in(figures)) {
        if (!peer.ours()) continue;
        add(peer, "batch", false, false);
        add(peer, "single", true, false);
        add(peer, "single_robust", true, true);
    }
    return ratios;
}

std::vector<Ratio> ratios_of(const SceneFigures& figures) {
    std::vector<Ratio> ratios;
    add_build_ratios(figures, ratios);
    for (const WorkloadFigures& w : figures.workloads)
        for (const Ratio& ratio : workload_ratios(figures, w)) ratios.push_back(ratio);
    return ratios;
}

std::vector<SpeedUp> speed_ups_of(const SceneFigures& figures) {
    std::vector<SpeedUp> all;
    if (figures.threads == 1) return all;
    for (const PeerName& peer : peers_in(figures)) {
        std::map<int, double> kept;
        for (const BuildFigures& b : figures.builds)
            if (b.peer.text == peer.text) kept[b.threads] = b.kept_ms.median;
        if (kept.contains(1))
            all.push_back({peer.text, "", "kept_ms", kept[1] / kept[figures.threads]});
        for (const WorkloadFigures& w : figures.workloads)
            for (const bool single : {false, true}) {
                const ModeFigures* most = fastest(figures, w, [&](const ModeFigures& m) {
                    return m.peer.text == peer.text &&
                           (single ? m.single : m.automatic || !peer.ours());
                });
                if (most == nullptr) continue;
                for (const ModeFigures& one : w.modes)
                    if (one.peer.text == peer.text && one.threads == 1 && one.name == most->name)
                        all.push_back({peer.text, w.name, single ? "single" : "batch",
                                       most->mrays_per_s->median / one.mrays_per_s->median});
            }
    }
    return all;
}

std::vector<SummaryRow> summary_of(const std::vector<SceneFigures>& scenes) {
    std::vector<Values> rows, of_groups;
    for (const SceneFigures& figures : scenes) {
        std::vector<Ratio> builds;
        add_build_ratios(figures, builds);
        for (const Ratio& ratio : builds)
            add_value(rows, figures.group, ratio, "", {ratio.value, figures.scene, ""});
        for (const WorkloadFigures& w : figures.workloads)
            for (const Ratio& ratio : workload_ratios(figures, w)) {
                const Values::Value value{ratio.value, figures.scene, w.name};
                add_value(rows, figures.group, ratio, w.name, value);
                const std::string kind = group_of_workloads(w, ratio);
                if (!kind.empty()) add_value(of_groups, figures.group, ratio, kind, value);
            }
    }
    for (const char* name : workload_groups)
        std::ranges::copy_if(of_groups, std::back_inserter(rows),
                             [&](const Values& v) { return v.row.workload == name; });
    std::vector<SummaryRow> summary;
    for (const Values& row : rows) summary.push_back(row.summed_up());
    return summary;
}

Json summary_json(const std::vector<SummaryRow>& rows) {
    Json summary = Json::array();
    for (const SummaryRow& row : rows)
        summary.push_back({{"group", row.group},
                           {"raydix", row.ours},
                           {"embree", row.embree},
                           {"workload", row.workload.empty() ? Json(nullptr) : Json(row.workload)},
                           {"figure", row.figure},
                           {"median", row.median},
                           {"worst", row.worst},
                           {"worst_scene", row.worst_scene},
                           {"worst_workload",
                            row.worst_workload.empty() ? Json(nullptr) : Json(row.worst_workload)},
                           {"scenes", row.scenes}});
    return summary;
}

}  // namespace raydix::bench
