#include "cpu_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <tuple>

namespace raydix::bench {
namespace {

using cli::Json;
using cli::Spread;

Spread rate_of(const KindRates& kind, const ModeRates& mode) {
    std::vector<double> rates;
    for (const double ms : mode.ms) rates.push_back(double(kind.rays) / ms * 1e-3);
    return cli::spread_of(rates);
}

/// Else a time or a number of bytes.
bool is_rate(const std::string& figure) { return !figure.ends_with("_ms") && figure != "bytes"; }

enum class Call { batch, single };
constexpr std::array calls{Call::batch, Call::single};
const char* call_name(Call call) { return call == Call::batch ? "batch" : "single"; }

/// What stands for a peer in ratios. Ours: what a user gets who asks for nothing. Embree's: the
/// fastest of the modes, whatever a user would have to know to pick it.
const ModeRates* chosen_mode(const SceneFigures& figures, const KindRates& kind, std::size_t peer,
                             Call call) {
    const ModeRates* best = nullptr;
    double best_rate = 0;
    for (const ModeRates& m : kind.modes) {
        if (m.peer != peer || m.threads != figures.threads) continue;
        if (call == Call::single && !m.mode.single) continue;
        if (call == Call::batch && figures.peers[peer].ours() && !m.mode.automatic) continue;
        const double rate = rate_of(kind, m).median;
        if (best == nullptr || rate > best_rate) {
            best = &m;
            best_rate = rate;
        }
    }
    return best;
}

/// Peer -> figure -> value, with the number of threads that is compared.
std::map<std::string, double> figures_of_peer(const SceneFigures& figures, std::size_t peer) {
    std::map<std::string, double> all;
    for (const PeerBuilds& b : figures.builds) {
        if (b.peer.text != figures.peers[peer].text || b.threads != figures.threads) continue;
        all["fresh_ms"] = cli::spread_of(b.fresh_ms).median;
        all["kept_ms"] = cli::spread_of(b.kept_ms).median;
        all["bytes"] = double(b.bytes.own);
    }
    for (const KindRates& kind : figures.kinds)
        for (const Call call : calls)
            if (const ModeRates* mode = chosen_mode(figures, kind, peer, call); mode && kind.rays)
                all[fmt::format("{}_{}", ray_kind_name(kind.kind), call_name(call))] =
                    rate_of(kind, *mode).median;
    return all;
}

/// In the order of the tables.
std::vector<std::string> figure_names(const SceneFigures& figures) {
    std::vector<std::string> names;
    if (!figures.builds.empty()) names = {"fresh_ms", "kept_ms", "bytes"};
    for (const KindRates& kind : figures.kinds)
        for (const Call call : calls)
            names.push_back(fmt::format("{}_{}", ray_kind_name(kind.kind), call_name(call)));
    return names;
}

Json build_json(const PeerBuilds& b, std::uint64_t triangles) {
    return {{"peer", b.peer.text},
            {"threads", b.threads},
            {"fresh_ms", spread_json(cli::spread_of(b.fresh_ms))},
            {"kept_ms", spread_json(cli::spread_of(b.kept_ms))},
            {"layout_ms",
             b.layout_ms.empty() ? Json(nullptr) : spread_json(cli::spread_of(b.layout_ms))},
            {"bytes", b.bytes.own},
            {"bytes_referenced", b.bytes.referenced},
            {"bytes_per_triangle", double(b.bytes.own) / double(triangles)},
            {"sah", b.sah ? Json(*b.sah) : Json(nullptr)}};
}

Json kind_json(const SceneFigures& figures, const KindRates& kind) {
    Json json{{"rays", ray_kind_name(kind.kind)},
              {"count", kind.rays},
              {"launches", kind.launches},
              {"modes", Json::array()}};
    for (const ModeRates& m : kind.modes) {
        const PeerName& peer = figures.peers[m.peer];
        Json mode{{"peer", peer.text},
                  {"mode", m.mode.name},
                  {"call", call_name(m.mode.single ? Call::single : Call::batch)},
                  {"threads", m.threads},
                  {"mrays_per_s", kind.rays ? spread_json(rate_of(kind, m)) : Json(nullptr)},
                  {"different_hits", nullptr}};
        if (!peer.ours())
            mode["different_hits"] = {{"hit_or_miss", m.differences.hit_or_miss},
                                      {"distance", m.differences.distance}};
        json["modes"].push_back(mode);
    }
    return json;
}

/// How much faster than with one thread; the mode is the one that is chosen with all.
Json speed_ups_json(const SceneFigures& figures) {
    Json all = Json::array();
    const auto add = [&](const std::string& peer, const std::string& figure, double value) {
        all.push_back({{"peer", peer}, {"figure", figure}, {"speed_up", value}});
    };
    for (std::size_t p = 0; p < figures.peers.size(); ++p) {
        const std::string& name = figures.peers[p].text;
        std::map<int, double> kept;
        for (const PeerBuilds& b : figures.builds)
            if (b.peer.text == name) kept[b.threads] = cli::spread_of(b.kept_ms).median;
        if (kept.contains(1) && figures.threads != 1)
            add(name, "kept_ms", kept[1] / kept[figures.threads]);
        for (const KindRates& kind : figures.kinds)
            for (const Call call : calls) {
                const ModeRates* most = chosen_mode(figures, kind, p, call);
                const auto one =
                    std::find_if(kind.modes.begin(), kind.modes.end(), [&](const ModeRates& m) {
                        return most && m.peer == p && m.threads == 1 &&
                               m.mode.name == most->mode.name;
                    });
                if (one != kind.modes.end() && figures.threads != 1 && kind.rays)
                    add(name, fmt::format("{}_{}", ray_kind_name(kind.kind), call_name(call)),
                        rate_of(kind, *most).median / rate_of(kind, *one).median);
            }
    }
    return all;
}

void print_builds(const SceneFigures& figures) {
    fmt::print("\n{:<24} {:>7} {:>9} {:>19} {:>9} {:>9} {:>9} {:>9} {:>8}\n", "tree", "threads",
               "fresh ms", "(min to max)", "kept ms", "layout", "SAH", "MB", "B/tri");
    for (const PeerBuilds& b : figures.builds) {
        const Spread fresh = cli::spread_of(b.fresh_ms);
        const std::string layout =
            b.layout_ms.empty() ? "-" : fmt::format("{:.2f}", cli::spread_of(b.layout_ms).median);
        fmt::print(
            "{:<24} {:>7} {:>9.2f} {:>19} {:>9.2f} {:>9} {:>9} {:>9.2f} {:>8.1f}\n", b.peer.text,
            b.threads, fresh.median, fmt::format("({:.2f} to {:.2f})", fresh.min, fresh.max),
            cli::spread_of(b.kept_ms).median, layout, b.sah ? fmt::format("{:.3f}", *b.sah) : "-",
            double(b.bytes.own) / 1e6, double(b.bytes.own) / double(figures.triangles));
        if (b.bytes.referenced != 0)
            fmt::print("{:>33} reads another {:.2f} MB of the caller's vertices\n", "",
                       double(b.bytes.referenced) / 1e6);
    }
}

void print_rates(const SceneFigures& figures) {
    fmt::print(
        "\nMrays/s, medians; in brackets the spread, (max - min) / median\n{:<24} {:<24} "
        "{:>7}",
        "tree", "mode", "threads");
    for (const KindRates& kind : figures.kinds) fmt::print(" {:>16}", ray_kind_name(kind.kind));
    fmt::print(" {:>13}\n", "other hits");
    for (std::size_t m = 0; m < figures.kinds.front().modes.size(); ++m) {
        const ModeRates& first = figures.kinds.front().modes[m];
        fmt::print("{:<24} {:<24} {:>7}", figures.peers[first.peer].text, first.mode.name,
                   first.threads);
        std::uint64_t other = 0;
        for (const KindRates& kind : figures.kinds) {
            other += kind.modes[m].differences.sum();
            if (kind.rays == 0) {
                fmt::print(" {:>16}", "-");
                continue;
            }
            const Spread rate = rate_of(kind, kind.modes[m]);
            fmt::print(" {:>9.2f} ({:>3.0f}%)", rate.median,
                       100 * (rate.max - rate.min) / rate.median);
        }
        fmt::print(" {:>13}\n", figures.peers[first.peer].ours() ? "-" : cli::grouped(other));
    }
}

/// Which hits differ, by kind of ray, for the mode of each of Embree's trees that has most.
void print_differences(const SceneFigures& figures) {
    for (const KindRates& kind : figures.kinds)
        for (std::size_t p = 0; p < figures.peers.size(); ++p) {
            Differences most;
            for (const ModeRates& m : kind.modes)
                if (m.peer == p && m.differences.sum() > most.sum()) most = m.differences;
            if (most.sum() != 0)
                fmt::print(
                    "{}, {} rays: of {} answers {} are hit instead of miss or the reverse, "
                    "{} at another distance\n",
                    figures.peers[p].text, ray_kind_name(kind.kind), cli::grouped(kind.rays),
                    cli::grouped(most.hit_or_miss), cli::grouped(most.distance));
        }
}

/// A row for each name of `rows`, in the order of `order`; a column for each figure.
void print_grid(const std::vector<std::string>& columns, const std::vector<std::string>& order,
                std::map<std::string, std::map<std::string, double>>& rows) {
    fmt::print("{:<32}", "");
    for (const std::string& name : columns) {
        const bool shuffled = name.starts_with("diffuse_shuffled");
        fmt::print(" {:>15}", shuffled ? name.substr(8) : name);
    }
    fmt::print("\n");
    for (const std::string& row : order) {
        fmt::print("{:<32}", row);
        for (const std::string& name : columns)
            fmt::print(" {:>15}",
                       rows[row].contains(name) ? fmt::format("{:.2f}", rows[row][name]) : "-");
        fmt::print("\n");
    }
}

void print_ratios(const SceneFigures& figures) {
    std::map<std::string, std::map<std::string, double>> rows;
    std::vector<std::string> order;
    for (const Ratio& r : ratios_of(figures)) {
        const std::string row = r.ours + " / Embree " + r.embree;
        if (!rows.contains(row)) order.push_back(row);
        rows[row][r.figure] = r.value;
    }
    fmt::print("\nours / Embree's: rates (more is better), times and bytes (less is better)\n");
    print_grid(figure_names(figures), order, rows);
}

void print_speed_ups(const SceneFigures& figures) {
    std::map<std::string, std::map<std::string, double>> rows;
    std::vector<std::string> order;
    for (const Json& s : speed_ups_json(figures)) {
        const std::string row = s["peer"].get<std::string>();
        if (!rows.contains(row)) order.push_back(row);
        rows[row][s["figure"].get<std::string>()] = s["speed_up"].get<double>();
    }
    if (order.empty()) return;
    fmt::print("\nspeed-up from 1 to {} threads\n", figures.threads);
    print_grid(figure_names(figures), order, rows);
}

}  // namespace

std::vector<Ratio> ratios_of(const SceneFigures& figures) {
    std::map<std::string, double> best;
    std::vector<std::map<std::string, double>> of_peer;
    for (std::size_t p = 0; p < figures.peers.size(); ++p) {
        of_peer.push_back(figures_of_peer(figures, p));
        if (figures.peers[p].ours()) continue;
        for (const auto& [name, value] : of_peer.back())
            if (is_rate(name)) best[name] = std::max(best[name], value);
    }
    std::vector<Ratio> ratios;
    const auto add = [&](std::size_t ours, const std::string& embree,
                         const std::map<std::string, double>& theirs) {
        for (const std::string& name : figure_names(figures)) {
            if (!of_peer[ours].contains(name) || !theirs.contains(name)) continue;
            ratios.push_back({figures.peers[ours].kind(), embree, name,
                              of_peer[ours].at(name) / theirs.at(name)});
        }
    };
    for (std::size_t p = 0; p < figures.peers.size(); ++p) {
        if (!figures.peers[p].ours()) continue;
        for (std::size_t e = 0; e < figures.peers.size(); ++e)
            if (!figures.peers[e].ours()) add(p, figures.peers[e].kind(), of_peer[e]);
        add(p, "best", best);
    }
    return ratios;
}

Json figures_json(const SceneFigures& figures) {
    Json json{{"name", figures.scene},      {"triangles", figures.triangles},
              {"threads", figures.threads}, {"builds", Json::array()},
              {"rays", Json::array()},      {"ratios", Json::array()},
              {"speed_ups", Json::array()}};
    for (const PeerBuilds& b : figures.builds)
        json["builds"].push_back(build_json(b, figures.triangles));
    for (const KindRates& kind : figures.kinds) json["rays"].push_back(kind_json(figures, kind));
    for (const Ratio& r : ratios_of(figures))
        json["ratios"].push_back(
            {{"raydix", r.ours}, {"embree", r.embree}, {"figure", r.figure}, {"ratio", r.value}});
    json["speed_ups"] = speed_ups_json(figures);
    return json;
}

void print_figures(const SceneFigures& figures) {
    fmt::print("\n{}: {} triangles, {} threads\n", figures.scene, cli::grouped(figures.triangles),
               figures.threads);
    if (!figures.builds.empty()) print_builds(figures);
    if (!figures.kinds.empty()) {
        print_rates(figures);
        print_differences(figures);
    }
    print_ratios(figures);
    print_speed_ups(figures);
}

Json summary_json(const std::vector<SceneFigures>& scenes) {
    struct Row {
        Ratio key;
        std::vector<std::pair<double, std::string>> values;
    };
    std::vector<Row> rows;
    for (const SceneFigures& figures : scenes)
        for (const Ratio& r : ratios_of(figures)) {
            const auto same = [&](const Row& row) {
                return std::tie(row.key.ours, row.key.embree, row.key.figure) ==
                       std::tie(r.ours, r.embree, r.figure);
            };
            auto row = std::find_if(rows.begin(), rows.end(), same);
            if (row == rows.end()) row = rows.insert(rows.end(), Row{r, {}});
            row->values.emplace_back(r.value, figures.scene);
        }
    Json summary = Json::array();
    for (Row& row : rows) {
        std::vector<double> values;
        for (const auto& [value, scene] : row.values) values.push_back(value);
        const auto [least, most] = std::minmax_element(row.values.begin(), row.values.end());
        const auto& worst = is_rate(row.key.figure) ? *least : *most;
        summary.push_back({{"raydix", row.key.ours},
                           {"embree", row.key.embree},
                           {"figure", row.key.figure},
                           {"median", cli::spread_of(values).median},
                           {"worst", worst.first},
                           {"worst_scene", worst.second}});
    }
    return summary;
}

void print_summary(const Json& summary) {
    fmt::print(
        "\nover all scenes: ratio of ours to Embree's\n{:<18} {:<22} {:<24} {:>8} {:>8}  "
        "{}\n",
        "raydix", "over Embree", "figure", "median", "worst", "worst scene");
    for (const Json& row : summary)
        fmt::print("{:<18} {:<22} {:<24} {:>8.2f} {:>8.2f}  {}\n", row["raydix"].get<std::string>(),
                   row["embree"].get<std::string>(), row["figure"].get<std::string>(),
                   row["median"].get<double>(), row["worst"].get<double>(),
                   row["worst_scene"].get<std::string>());
}

}  // namespace raydix::bench
