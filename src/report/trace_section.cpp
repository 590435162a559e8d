// Documents of `trace` -> rates by kind of ray, and what a ray costs.
#include <fmt/format.h>

#include <algorithm>

#include "report/bar_plot.h"
#include "report/html.h"
#include "report/number_text.h"
#include "report/sections.h"
#include "report/table.h"

namespace raydix::report {
namespace {

using Format = Column::Format;

struct TraceRow {
    const Document* document;
    const Json* trace;
    std::string scene, name, rays;  // name: rays, kernel and builder
    SpreadFields rate;
};

std::vector<TraceRow> trace_rows_of(const Documents& documents) {
    std::vector<TraceRow> rows;
    for (const Document& document : documents)
        for (const Json* trace : objects_at(document.root, "trace"))
            rows.push_back({&document, trace, scene_name(document.root), "",
                            text_at(*trace, "rays"), spread_at(*trace, "mrays_per_s")});
    return rows;
}

/// Names the rows of one scene; returns what they share.
std::string name_rows(std::vector<TraceRow>& rows) {
    std::vector<std::vector<std::string>> parts;
    std::vector<std::string> sources;
    for (const TraceRow& row : rows) {
        const std::string mode = text_at(*row.trace, "mode"),
                          kernel = text_at(*row.trace, "kernel"),
                          builder = text_at(row.document->root, "build.builder");
        parts.push_back(
            {row.rays, mode.empty() ? "" : mode + " hit", kernel.empty() ? "" : "kernel " + kernel,
             builder.empty() ? "" : "tree of " + builder, text_at(*row.trace, "device")});
        const std::string path = text_at(*row.trace, "path");
        parts.back().push_back(text_at(row.document->root, "build.layout"));
        parts.back().push_back(path.empty() ? "" : path + " path");
        parts.back().push_back(text_at(*row.trace, "isa"));
        for (const std::string& setting : tree_settings(at(row.document->root, "build")))
            parts.back().push_back(setting);
        sources.push_back(row.document->name);
    }
    Names names = distinct_names(parts, 0);
    tell_apart(names.each, sources);
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i].name = names.each[i];
    return names.common;
}

std::string plots_of(const std::string& subtitle, const std::vector<TraceRow>& rows) {
    BarPlot rates{.title = "Rays traced",
                  .subtitle = subtitle,
                  .note = "The bar is the median, the thin line spans all repeats.",
                  .label = "rate, Mrays/s",
                  .unit = "Mrays/s",
                  .origin = Origin::measured,
                  .parts = {{"rate", 0}}};
    BarPlot steps = rates;
    steps.title = "Work of a ray";
    steps.note = "Mean over all rays, counted in a run of its own.";
    steps.label = "node visits and triangle tests per ray";
    steps.unit = "steps";
    steps.parts = {{"node visits", 0}, {"triangle tests", 1}};
    for (const TraceRow& row : rows) {
        rates.bars.push_back({.label = row.name,
                              .parts = {or_nan(row.rate.median)},
                              .low = or_nan(row.rate.min),
                              .high = or_nan(row.rate.max)});
        steps.bars.push_back({.label = row.name,
                              .parts = {or_nan(number_at(*row.trace, "node_visits_per_ray")),
                                        or_nan(number_at(*row.trace, "triangle_tests_per_ray"))}});
    }
    return bar_plot(rates) + bar_plot(steps);
}

std::string table_of(const std::vector<TraceRow>& rows) {
    Table table{.title = "Traces",
                .origin = Origin::measured,
                .columns = {{"scene"},
                            {"rays"},
                            {"mode"},
                            {"kernel"},
                            {"device"},
                            {"tree of"},
                            {"layout"},
                            {"path"},
                            {"code"},
                            {"camera"},
                            {"size"},
                            {"samples", Format::integer},
                            {"rays traced", Format::integer},
                            {"hits", Format::percent, "of the rays"},
                            {"rate", Format::number, "Mrays/s, median"},
                            {"least", Format::number, "Mrays/s"},
                            {"most", Format::number, "Mrays/s"},
                            {"node visits", Format::number, "per ray"},
                            {"triangle tests", Format::number, "per ray"},
                            {"invalid", Format::integer, "rays"},
                            {"document"}}};
    for (const TraceRow& row : rows) {
        const Json& t = *row.trace;
        const auto count = number_at(t, "count"), hits = number_at(t, "hits");
        std::optional<double> share;
        // All-hits counts may exceed the rays: then there is no share.
        if (count && hits && *count > 0 && *hits <= *count) share = *hits / *count;
        table.rows.push_back({row.scene,
                              row.rays,
                              text_at(t, "mode"),
                              text_at(t, "kernel"),
                              text_at(t, "device"),
                              text_at(row.document->root, "build.builder"),
                              text_at(row.document->root, "build.layout"),
                              text_at(t, "path"),
                              text_at(t, "isa"),
                              text_at(t, "camera"),
                              text_at(t, "size"),
                              number_at(t, "samples"),
                              count,
                              share,
                              row.rate.median,
                              row.rate.min,
                              row.rate.max,
                              number_at(t, "node_visits_per_ray"),
                              number_at(t, "triangle_tests_per_ray"),
                              number_at(t, "invalid_rays"),
                              row.document->name});
    }
    table.drop_empty_columns();
    return table_html(table);
}

void say(const std::string& scene, const std::vector<TraceRow>& rows, Section& section) {
    std::vector<TraceRow> timed;
    for (const TraceRow& row : rows)
        if (row.rate.median) timed.push_back(row);
    if (timed.empty()) return;
    const auto [slow, fast] =
        std::ranges::minmax(timed, {}, [](const TraceRow& row) { return *row.rate.median; });
    std::string said =
        fmt::format("Measured on {}: through the tree of {} go {} for {}",
                    escaped(machine_text(*fast.document)), breakable(scene),
                    strong(significant(*fast.rate.median), "Mrays/s"), escaped(fast.name));
    if (timed.size() > 1)
        said += fmt::format(", the best of {}; the least is {} for {}", timed.size(),
                            strong(significant(*slow.rate.median), "Mrays/s"), escaped(slow.name));
    section.summary.push_back(said + ".");
    section.tiles.push_back({significant(*fast.rate.median), "Mrays/s",
                             "best rate through " + scene + ": " + fast.rays,
                             badge(Origin::measured)});
}

}  // namespace

Section trace_section(const Documents& documents) {
    Section section{.id = "traces", .title = "Traces"};
    const std::vector<TraceRow> rows = trace_rows_of(documents);
    std::vector<std::string> scenes;
    for (const TraceRow& row : rows)
        if (std::ranges::find(scenes, row.scene) == scenes.end()) scenes.push_back(row.scene);
    std::string plots;
    for (const std::string& scene : scenes) {
        std::vector<TraceRow> some = rows;
        std::erase_if(some, [&](const TraceRow& row) { return row.scene != scene; });
        const std::string shared = name_rows(some);
        plots += plots_of(shared.empty() ? scene : scene + ", " + shared, some);
        say(scene, some, section);
    }
    if (!plots.empty()) section.html = "<div class=\"plots\">" + plots + "</div>\n";
    section.html += table_of(rows);
    return section;
}

}  // namespace raydix::report
