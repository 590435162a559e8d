#include "cpu_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

namespace raydix::bench {
namespace {

using cli::Spread;

/// "95.21 ( 3%)": in brackets (max - min) / median.
std::string rate_text(const ModeFigures* mode) {
    if (mode == nullptr || !mode->mrays_per_s) return "-";
    const Spread& rate = *mode->mrays_per_s;
    return fmt::format("{:.2f} ({:>2.0f}%)", rate.median,
                       100 * (rate.max - rate.min) / rate.median);
}

const Ratio* ratio_of(const std::vector<Ratio>& ratios, const std::string& ours,
                      const std::string& figure) {
    const auto found = std::ranges::find_if(
        ratios, [&](const Ratio& r) { return r.ours == ours && r.figure == figure; });
    return found == ratios.end() ? nullptr : &*found;
}

std::string ratio_text(const Ratio* ratio) {
    return ratio == nullptr ? "-" : fmt::format("{:.2f}", ratio->value);
}

void print_builds(const SceneFigures& figures) {
    fmt::print("{:<24} {:>7} {:>9} {:>19} {:>9} {:>9} {:>9} {:>9} {:>8}\n", "tree", "threads",
               "fresh ms", "(min to max)", "kept ms", "copy", "SAH", "MB", "B/tri");
    for (const BuildFigures& b : figures.builds) {
        fmt::print("{:<24} {:>7} {:>9.2f} {:>19} {:>9.2f} {:>9} {:>9} {:>9.2f} {:>8.1f}\n",
                   b.peer.text, b.threads, b.fresh_ms.median,
                   fmt::format("({:.2f} to {:.2f})", b.fresh_ms.min, b.fresh_ms.max),
                   b.kept_ms.median, b.copy_ms ? fmt::format("{:.2f}", b.copy_ms->median) : "-",
                   b.sah ? fmt::format("{:.3f}", *b.sah) : "-", double(b.bytes.own) / 1e6,
                   double(b.bytes.own) / double(figures.triangles));
        if (b.bytes.referenced != 0)
            fmt::print("{:>33} reads another {:.2f} MB of the caller's vertices\n", "",
                       double(b.bytes.referenced) / 1e6);
    }
}

/// Of the mode of each of Embree's trees that has most.
void print_differences(const WorkloadFigures& workload) {
    std::map<std::string, Differences> most;
    for (const ModeFigures& m : workload.modes)
        if (!m.peer.ours() && m.differences.sum() > most[m.peer.text].sum())
            most[m.peer.text] = m.differences;
    for (const auto& [peer, other] : most)
        if (other.sum() != 0)
            fmt::print(
                "    {}: of {} answers {} are hit instead of miss or the reverse, {} at "
                "another distance\n",
                peer, cli::grouped(workload.rays), cli::grouped(other.hit_or_miss),
                cli::grouped(other.distance));
}

void print_modes(const WorkloadFigures& workload) {
    for (const ModeFigures& m : workload.modes)
        fmt::print("    {:<24} {:<24} {:>2} {:<8} {:>15} {:>13}\n", m.peer.text, m.name, m.threads,
                   m.threads == 1 ? "thread" : "threads", rate_text(&m),
                   m.peer.ours() ? "-" : cli::grouped(m.differences.sum()));
}

/// A row of the table of a summary: cells by figure.
using Cells = std::map<std::string, const SummaryRow*>;

std::string cell_text(const Cells& cells, const std::string& figure) {
    const auto found = cells.find(figure);
    if (found == cells.end()) return "-";
    return fmt::format("{:.2f} / {:.2f}", found->second->median, found->second->worst);
}

void print_row(const std::string& name, const Cells& cells) {
    const auto batch = cells.find("batch");
    const SummaryRow* named = batch != cells.end() ? batch->second : cells.begin()->second;
    fmt::print("  {:<32} {:>13} {:>13} {:>13}  {}\n", name, cell_text(cells, "batch"),
               cell_text(cells, "single"), cell_text(cells, "single_robust"),
               named->worst_workload.empty() ? named->worst_scene
                                             : named->worst_scene + ", " + named->worst_workload);
}

/// Rows of one group and one of our trees.
void print_table(const std::vector<const SummaryRow*>& rows) {
    std::size_t scenes = 0;
    std::string beside;
    for (const SummaryRow* row : rows) {
        scenes = std::max(scenes, row->scenes);
        if (beside.empty() && row->figure == "batch") beside = row->embree;
    }
    const SummaryRow& first = *rows.front();
    fmt::print("\n{}: {}, raydix {} over Embree, median / worst\n",
               first.group == "tuned" ? "tuned" : "held out",
               cli::counted(scenes, "scene", "scenes"), first.ours);
    for (const SummaryRow* row : rows)
        if (row->workload.empty())
            fmt::print("  {:<32} {:>13}                              {}\n",
                       row->figure + ", " + row->embree,
                       fmt::format("{:.2f} / {:.2f}", row->median, row->worst), row->worst_scene);
    if (beside.empty()) return;
    fmt::print("  {:<32} {:>13} {:>13} {:>13}  {}\n", "rates, " + beside, "default call", "single",
               "over ROBUST", "worst scene");
    std::vector<std::string> order;
    std::map<std::string, Cells> table;
    for (const SummaryRow* row : rows) {
        if (row->workload.empty()) continue;
        if (!table.contains(row->workload)) order.push_back(row->workload);
        table[row->workload][row->figure] = row;
    }
    for (const std::string& workload : order) print_row(workload, table[workload]);
}

}  // namespace

void print_scene(const SceneFigures& figures) {
    fmt::print("\n{}{}: {} triangles, {} threads\n", figures.scene,
               figures.group == "tuned" ? "" : " (held out)", cli::grouped(figures.triangles),
               figures.threads);
    if (!figures.builds.empty()) print_builds(figures);
}

void print_head_of_workloads(int rounds, const std::string& clock) {
    fmt::print(
        "\nMrays/s, {} time, medians of {} rounds; in brackets the spread, (max - min) / median\n"
        "{:<18} {:>9} {:>9} {:<18} {:>15} {:>6} {:<34} {:>14} {:>6} {:>6}\n",
        clock, rounds, "workload", "rays", "a call", "raydix", "default call", "ratio",
        "over Embree's", "single", "ratio", "robust");
}

void print_workload(const SceneFigures& figures, const WorkloadFigures& workload, bool all_modes) {
    std::vector<std::string> ours;
    for (const ModeFigures& m : workload.modes)
        if (m.automatic && m.threads == figures.threads) ours.push_back(m.peer.kind());
    const std::vector<Ratio> ratios = workload_ratios(figures, workload);
    for (const std::string& kind : ours) {
        const bool first = kind == ours.front();
        const Ratio* batch = ratio_of(ratios, kind, "batch");
        fmt::print("{:<18} {:>9} {:>9} {:<18} {:>15} {:>6} {:<34} {:>14} {:>6} {:>6}\n",
                   first ? workload.name : "", first ? cli::grouped(workload.rays) : "",
                   first ? cli::grouped(std::uint64_t(workload.rays_a_call())) : "", kind,
                   rate_text(default_mode(figures, workload, kind, false)), ratio_text(batch),
                   batch == nullptr ? "-" : batch->best,
                   rate_text(default_mode(figures, workload, kind, true)),
                   ratio_text(ratio_of(ratios, kind, "single")),
                   ratio_text(ratio_of(ratios, kind, "single_robust")));
    }
    if (!ours.empty()) print_differences(workload);
    if (all_modes) print_modes(workload);
}

void print_speed_ups(const SceneFigures& figures) {
    const std::vector<SpeedUp> all = speed_ups_of(figures);
    if (all.empty()) return;
    fmt::print("\nspeed-up from 1 to {} threads\n", figures.threads);
    for (const SpeedUp& s : all)
        fmt::print("{:<24} {:<18} {:<8} {:>6.2f}\n", s.peer,
                   s.workload.empty() ? "builds" : s.workload, s.figure, s.value);
}

void print_summary(const std::vector<SummaryRow>& rows) {
    std::vector<std::vector<const SummaryRow*>> tables;
    for (const SummaryRow& row : rows) {
        auto table = std::ranges::find_if(tables, [&](const auto& t) {
            return t.front()->group == row.group && t.front()->ours == row.ours;
        });
        if (table != tables.end())
            table->push_back(&row);
        else
            tables.push_back({&row});
    }
    for (const auto& table : tables) print_table(table);
}

}  // namespace raydix::bench
