// Documents with simulated kernels -> bounds, where their instructions go, how full their warps
// are, how long warps run. Every figure here says that it is simulated.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "report/bar_plot.h"
#include "report/dot_plot.h"
#include "report/html.h"
#include "report/number_text.h"
#include "report/plain_tables.h"
#include "report/sections.h"
#include "report/simulate_rows.h"
#include "report/table.h"

namespace raydix::report {
namespace {

using Format = Column::Format;
const char* const bound_name = "bound: the issue limit alone, infinitely fast memory";
const char* const scheduled_name = "with work distribution and the tail of a launch";
using Rows = std::vector<const SimulatedRow*>;

std::vector<std::string> operations_of(const Rows& rows) {
    std::vector<std::string> names;
    for (const SimulatedRow* row : rows)
        for (const SimulatedOperation& op : row->operations)
            if (std::ranges::find(names, op.name) == names.end()) names.push_back(op.name);
    return names;
}

const SimulatedOperation* find(const SimulatedRow& row, const std::string& operation) {
    const auto found = std::ranges::find(row.operations, operation, &SimulatedOperation::name);
    return found == row.operations.end() ? nullptr : &*found;
}

std::string bound_plot(const std::string& rays, Rows rows) {
    std::ranges::stable_sort(rows, std::greater<>(),
                             [](const SimulatedRow* row) { return row->bound.value_or(-1); });
    BarPlot plot{.title = rays + " rays",
                 .label = "upper bound, Mrays/s",
                 .unit = "Mrays/s",
                 .origin = Origin::simulated,
                 .parts = {{bound_name, 0}}};
    plot.with_legend = false;
    for (const SimulatedRow* row : rows) {
        Bar bar{.label = row->kernel, .parts = {or_nan(row->bound)}};
        if (row->scheduled) {
            bar.mark = *row->scheduled;
            plot.mark_name = scheduled_name;
        }
        plot.bars.push_back(bar);
    }
    return bar_plot(plot);
}

std::string instruction_plot(const std::string& rays, const Rows& rows, PageColours& colours) {
    BarPlot plot{.title = rays + " rays",
                 .label = "warp instructions per ray",
                 .unit = "per ray",
                 .origin = Origin::simulated};
    plot.with_legend = false;
    const std::vector<std::string> operations = operations_of(rows);
    if (operations.empty()) return {};
    for (const std::string& name : operations)
        plot.parts.push_back({name, colours.operations.of(name)});
    for (const SimulatedRow* row : rows) {
        Bar bar{.label = row->kernel};
        for (const std::string& name : operations) {
            const SimulatedOperation* op = find(*row, name);
            bar.parts.push_back(
                op && op->issues_per_ray && op->cost ? *op->issues_per_ray * *op->cost : Bar::none);
        }
        plot.bars.push_back(bar);
    }
    return bar_plot(plot);
}

std::string time_plot(const std::string& rays, const Rows& rows) {
    HistogramPlot plot{.title = rays + " rays",
                       .label = "time of a warp, issues",
                       .items = "warps",
                       .origin = Origin::simulated};
    for (const SimulatedRow* row : rows) {
        if (row->times.counts.empty()) continue;
        if (!row->unit.empty()) plot.label = "time of a warp, " + row->unit;
        plot.rows.push_back(row->times);
    }
    return plot.rows.empty() ? "" : histogram_plot(plot);
}

DotPlot efficiency_plot(const std::string& rays, const Rows& rows, PageColours& colours) {
    DotPlot plot{.title = rays + " rays",
                 .label = "SIMD efficiency, %",
                 .origin = Origin::simulated,
                 .rows = operations_of(rows)};
    plot.rows.insert(plot.rows.begin(), "all operations");
    for (const SimulatedRow* row : rows) {
        const int colour = colours.kernels.of(row->kernel);
        DotSeries series{row->kernel, {or_nan(row->efficiency)}, colour, colour};
        for (std::size_t i = 1; i < plot.rows.size(); ++i) {
            const SimulatedOperation* op = find(*row, plot.rows[i]);
            series.parts.push_back(op ? or_nan(op->efficiency) : Bar::none);
        }
        plot.series.push_back(series);
    }
    return plot;
}

/// Kernels down, operations across, one table for all kinds of rays.
std::string efficiency_table(const SimulatedGroup& group) {
    Rows all;
    for (const SimulatedRow& row : group.rows) all.push_back(&row);
    const std::vector<std::string> operations = operations_of(all);
    if (operations.empty()) return {};
    Table table{.title = "SIMD efficiency by operation",
                .note =
                    "The share of a warp's lanes that do useful work when it issues an operation; "
                    "the darker, the fuller.",
                .origin = Origin::simulated,
                .columns = {{"kernel"}, {"rays"}, {"all", Format::percent}}};
    for (const std::string& name : operations) table.columns.push_back({name, Format::percent});
    for (const SimulatedRow* row : all) {
        std::vector<Cell> cells{row->kernel, row->rays};
        const auto add = [&](std::optional<double> efficiency, const std::string& tip) {
            Cell cell(efficiency);
            cell.shade = efficiency;
            cell.tip = tip;
            cells.push_back(cell);
        };
        add(row->efficiency, "all operations (simulated)");
        for (const std::string& name : operations) {
            const SimulatedOperation* op = find(*row, name);
            add(op ? op->efficiency : std::nullopt,
                op && op->share
                    ? name + ": " + percent(*op->share) + " of the instructions (simulated)"
                    : "");
        }
        table.rows.push_back(cells);
    }
    return table_html(table);
}

std::string row_table(const SimulatedGroup& group) {
    Table table{.title = "Simulated kernels",
                .note =
                    "Nothing in this table was timed. The bound is the issue limit alone; "
                    "\xE2\x80\x9Cscheduled\xE2\x80\x9D adds the distribution of work, "
                    "\xE2\x80\x9Cmemory\xE2\x80\x9D is the lowest of it and the limits of "
                    "caches, memory and latency.",
                .origin = Origin::simulated,
                .columns = {{"kernel"},
                            {"rays"},
                            {"mode"},
                            {"bound", Format::number, "Mrays/s"},
                            {"scheduled", Format::number, "Mrays/s"},
                            {"memory", Format::number, "Mrays/s"},
                            {"memory's limit"},
                            {"SIMD efficiency", Format::percent},
                            {"issues", Format::number, "per ray"},
                            {"instructions", Format::number, "per ray"},
                            {"median warp", Format::number, "issues"},
                            {"idle", Format::percent, "of the launch"},
                            {"count", Format::integer, "rays"},
                            {"hits", Format::integer},
                            {"sample", Format::percent, "of the rays"},
                            {"sampling error", Format::percent}}};
    for (const SimulatedRow& row : group.rows)
        table.rows.push_back({row.kernel, row.rays, row.mode, row.bound, row.scheduled, row.memory,
                              row.memory_limit, row.efficiency, row.issues, row.instructions,
                              histogram_median(row.times), row.idle, row.count, row.hits,
                              row.sample, row.error});
    table.drop_empty_columns();
    return table_html(table);
}

std::string plots_block(const std::string& title, const std::string& legend,
                        const std::string& plots) {
    if (plots.empty()) return {};
    return "<h4>" + title + " " + badge(Origin::simulated) + "</h4>\n" + legend +
           "<div class=\"plots\">" + plots + "</div>\n";
}

std::string group_html(const SimulatedGroup& group, PageColours& colours) {
    std::string bounds, instructions, times, fullness, kernels;
    std::vector<LegendItem> operations;
    Rows all;
    for (const SimulatedRow& row : group.rows) all.push_back(&row);
    for (const std::string& name : operations_of(all))
        operations.push_back({name, colours.operations.of(name)});
    for (const std::string& rays : group.ray_kinds()) {
        const Rows rows = group.of_kind(rays);
        bounds += bound_plot(rays, rows);
        instructions += instruction_plot(rays, rows, colours);
        times += time_plot(rays, rows);
        const DotPlot efficiency = efficiency_plot(rays, rows, colours);
        if (kernels.empty()) kernels = legend_html(legend_of(efficiency));
        fullness += dot_plot(efficiency);
    }
    return plots_block("Upper bounds",
                       legend_html({{bound_name, 0, LegendItem::Kind::outline},
                                    {scheduled_name, 0, LegendItem::Kind::mark}}),
                       bounds) +
           row_table(group) +
           plots_block("Where the instructions go",
                       "<p class=\"note\">Issues of an operation times its cost: what a warp pays, "
                       "however many of its lanes work.</p>" +
                           legend_html(operations),
                       instructions) +
           plots_block("How full warps are, by operation", kernels, fullness) +
           efficiency_table(group) +
           plots_block(
               "How long warps run",
               "<p class=\"note\">Each row is as high as its fullest bin; the black line has "
               "half of the warps on either side. A long tail means warps that keep a launch "
               "waiting.</p>",
               times);
}

/// " ± 3 %", two standard errors of the sample, behind a bound; nothing if all rays were traced.
std::string error_text(const SimulatedRow& row) {
    if (row.error) return *row.error > 0 ? " \xC2\xB1 " + percent(2 * *row.error) : "";
    return row.part.value_or(1) < 1 ? ", error not known" : "";
}

double highest(const SimulatedRow& row) { return *row.bound * (1 + 2 * row.error.value_or(0)); }

/// Kernels whose bounds the sample does not tell from the best one's.
std::string as_good(const Rows& bounded, const SimulatedRow& best) {
    const double least = *best.bound * (1 - 2 * best.error.value_or(0));
    std::vector<std::string> names;
    for (const SimulatedRow* row : bounded)
        if (row != &best && highest(*row) >= least) names.push_back(breakable(row->kernel));
    return names.empty() ? "" : ", within the error also " + listed(names);
}

/// The best bound of each machine.
void add_tiles(const std::vector<SimulatedGroup>& groups, Section& section) {
    std::map<std::string, const SimulatedRow*> best;
    for (const SimulatedGroup& group : groups)
        for (const SimulatedRow& row : group.rows) {
            const SimulatedRow*& top = best[row.machine];
            if (row.bound && (top == nullptr || *row.bound > *top->bound)) top = &row;
        }
    for (const auto& [machine, row] : best)
        if (row != nullptr)
            section.tiles.push_back(
                {significant(*row->bound), "Mrays/s" + error_text(*row),
                 fmt::format("highest bound on {}: {}, {}", machine, row->kernel, row->rays),
                 badge(Origin::simulated)});
}

void say(const SimulatedGroup& group, Section& section) {
    std::vector<std::string> parts;
    for (const std::string& rays : group.ray_kinds()) {
        Rows bounded = group.of_kind(rays);
        std::erase_if(bounded, [](const SimulatedRow* row) { return !row->bound; });
        if (bounded.empty()) continue;
        const auto [low, high] =
            std::ranges::minmax(bounded, {}, [](const SimulatedRow* row) { return *row->bound; });
        std::string part = fmt::format(
            "{} rays {}{} with {}{}", escaped(rays), strong(significant(*high->bound), "Mrays/s"),
            error_text(*high), breakable(high->kernel), as_good(bounded, *high));
        if (bounded.size() > 1)
            part += fmt::format(" (least: {} with {})", significant(*low->bound),
                                breakable(low->kernel));
        parts.push_back(part);
    }
    if (parts.empty()) return;
    section.summary.push_back(fmt::format("{} On {}, tracing {}, the best upper bounds are: {}.",
                                          badge(Origin::simulated), escaped(group.machine),
                                          breakable(group.scene), listed(parts)));
}

std::string machine_tables(const Documents& documents) {
    std::string tables;
    for (const Document& document : documents)
        if (const Json& machines = at(document.root, "machines");
            machines.is_array() && !objects_at(document.root, "simulate").empty())
            tables += plain_tables("Constants of the machines of " + document.name, machines,
                                   Origin::simulated);
    return tables.empty() ? ""
                          : "<details><summary>What the simulated machines are</summary>" + tables +
                                "</details>\n";
}

}  // namespace

Section simulate_section(const Documents& documents, PageColours& colours) {
    Section section{.id = "simulated", .title = "Simulated machines"};
    const std::vector<SimulatedGroup> groups = simulated_groups(simulated_rows(documents));
    if (groups.empty()) return section;
    section.html =
        "<p>Kernels run here warp by warp on a simulated machine that charges each operation its "
        "instructions. What comes out is an upper bound, not a time.</p>\n";
    constexpr std::size_t open_groups = 2;  // more would bury what follows
    for (std::size_t i = 0; i < groups.size(); ++i) {
        const SimulatedGroup& group = groups[i];
        std::string title = breakable(group.title());
        if (documents.size() > 1) title += " <small>" + breakable(group.document) + "</small>";
        section.html +=
            fmt::format("<details class=\"group\"{}><summary>{} {}</summary>\n{}</details>\n",
                        i < open_groups ? " open" : "", title, badge(Origin::simulated),
                        group_html(group, colours));
        say(group, section);
    }
    section.html += machine_tables(documents);
    add_tiles(groups, section);
    return section;
}

}  // namespace raydix::report
