// Documents of `build` -> times by stage, statistics of the trees, quality against time.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "report/bar_plot.h"
#include "report/html.h"
#include "report/line_plot.h"
#include "report/number_text.h"
#include "report/sections.h"
#include "report/svg.h"
#include "report/table.h"

namespace raydix::report {
namespace {

using Format = Column::Format;

struct BuildRow {
    const Document* document;
    const Json* build;
    std::string scene, name;     // name: the builder, and what tells it from others of the scene
    std::string device, shared;  // shared: settings of all of the scene
    std::optional<double> total, low, high, primitives, sah;
};

std::string device_of(const Json& build) {
    const std::string device = text_at(build, "device");
    const auto threads = number_at(build, "threads");
    return device == "cpu" && threads ? counted(*threads, "thread") : device;
}

/// Whether rows that differ in nothing but the layout are told apart.
enum class Layouts { apart, together };

/// Tree, builder, settings and layout, as texts to put beside each other.
std::vector<std::string> parts_of(const Json& build, Layouts layouts) {
    std::vector<std::string> parts{text_at(build, "tree"), text_at(build, "builder")};
    if (parts[0] == "bvh") parts[0].clear();
    for (const std::string& setting : tree_settings(build)) parts.push_back(setting);
    const std::string layout = text_at(build, "layout");
    const bool is_told = layouts == Layouts::apart && !layout.empty() && layout != "binary";
    parts.push_back(is_told ? layout + " layout" : "");
    parts.push_back(device_of(build));
    return parts;
}

void name_rows(std::vector<BuildRow>& rows, Layouts layouts) {
    for (BuildRow& row : rows) {
        if (!row.name.empty()) continue;
        std::vector<BuildRow*> group;
        std::vector<std::vector<std::string>> parts;
        std::vector<std::string> sources;
        for (BuildRow& other : rows)
            if (other.scene == row.scene) {
                group.push_back(&other);
                parts.push_back(parts_of(*other.build, layouts));
                sources.push_back(other.document->name);
            }
        Names names = distinct_names(parts, 1);
        tell_apart(names.each, sources);
        for (std::size_t i = 0; i < group.size(); ++i) {
            group[i]->name = names.each[i];
            group[i]->shared = names.common;
        }
    }
}

std::vector<BuildRow> rows_of(const Documents& documents) {
    std::vector<BuildRow> rows;
    for (const Document& document : documents) {
        const Json& build = at(document.root, "build");
        if (!build.is_object()) continue;
        rows.push_back({.document = &document,
                        .build = &build,
                        .scene = scene_name(document.root),
                        .name = {},
                        .device = device_of(build),
                        .shared = {},
                        .total = number_at(build, "ms.total"),
                        .low = number_at(build, "ms_spread.min.total"),
                        .high = number_at(build, "ms_spread.max.total"),
                        .primitives = number_at(build, "primitives"),
                        .sah = number_at(build, "sah")});
    }
    return rows;
}

/// Each tree once, or in each of its layouts: every trace of a scene brings the same one again.
std::vector<BuildRow> different_trees(const std::vector<BuildRow>& rows, Layouts layouts) {
    std::vector<BuildRow> trees;
    std::set<std::vector<std::string>> seen;
    for (const BuildRow& row : rows) {
        std::vector<std::string> identity = parts_of(*row.build, layouts);
        identity.push_back(row.scene);
        identity.push_back(text_at(*row.build, "tree_hash"));
        if (layouts == Layouts::apart) identity.push_back(text_at(*row.build, "bytes"));
        if (seen.insert(identity).second) trees.push_back(row);
    }
    name_rows(trees, layouts);
    return trees;
}

/// Scenes in the order of the documents.
std::vector<std::string> scenes_of(const std::vector<BuildRow>& rows) {
    std::vector<std::string> scenes;
    for (const BuildRow& row : rows)
        if (std::ranges::find(scenes, row.scene) == scenes.end()) scenes.push_back(row.scene);
    return scenes;
}

std::vector<BuildRow> rows_of_scene(const std::vector<BuildRow>& rows, const std::string& scene) {
    std::vector<BuildRow> some;
    for (const BuildRow& row : rows)
        if (row.scene == scene) some.push_back(row);
    return some;
}

/// Known stages in the order in which they run, others behind them.
std::vector<std::string> stages_of(const std::vector<BuildRow>& rows) {
    std::vector<std::string> stages{"bounds", "codes", "sort", "hierarchy", "fit", "layout"};
    const std::size_t known = stages.size();
    for (const BuildRow& row : rows)
        for (const auto& [stage, ms] : at(*row.build, "ms").items())
            if (stage != "total" && std::ranges::find(stages, stage) == stages.end())
                stages.push_back(stage);
    for (std::size_t i = known; i-- > 0;) {
        const bool used = std::ranges::any_of(rows, [&](const BuildRow& row) {
            return number_at(*row.build, "ms." + stages[i]).value_or(0) > 0;
        });
        if (!used) stages.erase(stages.begin() + static_cast<std::ptrdiff_t>(i));
    }
    return stages;
}

std::string with_settings(const BuildRow& row) {
    return row.shared.empty() ? row.scene : row.scene + ", " + row.shared;
}

std::string stage_plot(std::vector<BuildRow> rows, PageColours& colours) {
    std::erase_if(rows, [](const BuildRow& row) { return !at(*row.build, "ms").is_object(); });
    if (rows.empty()) return {};
    std::ranges::stable_sort(rows, {}, [](const BuildRow& row) {
        return row.total.value_or(std::numeric_limits<double>::infinity());
    });
    BarPlot plot{.title = "Build time by stage",
                 .subtitle = with_settings(rows.front()),
                 .note = "Medians of the stages; the thin line spans the totals of all repeats.",
                 .label = "time, ms",
                 .unit = "ms",
                 .origin = Origin::measured};
    const std::vector<std::string> stages = stages_of(rows);
    for (const std::string& stage : stages) plot.parts.push_back({stage, colours.stages.of(stage)});
    for (const BuildRow& row : rows) {
        Bar bar{.label = row.name,
                .total = or_nan(row.total),
                .low = or_nan(row.low),
                .high = or_nan(row.high)};
        for (const std::string& stage : stages)
            bar.parts.push_back(or_nan(number_at(*row.build, "ms." + stage)));
        plot.bars.push_back(bar);
    }
    return bar_plot(plot);
}

/// A point for each build: how long it took, how good the tree is.
std::string quality_plot(const std::vector<BuildRow>& rows, PageColours& colours) {
    LinePlot plot;
    plot.title = "Quality against build time";
    plot.subtitle = with_settings(rows.front());
    plot.note = "Down is a cheaper tree, left is a faster build.";
    plot.x_label = "build time, ms (log scale)";
    plot.y_label = "SAH cost, nodes and triangles of an average ray";
    plot.x_unit = "ms";
    plot.x_scale = LinePlot::Scale::log;
    plot.origin = Origin::measured;
    for (const BuildRow& row : rows) {
        if (!row.sah || !row.total) continue;
        const int colour = colours.builders.of(text_at(*row.build, "builder"));
        plot.series.push_back({.name = row.name,
                               .x = {*row.total},
                               .y = {*row.sah},
                               .colour = colour,
                               .shape = static_cast<int>(plot.series.size()),
                               .markers_only = true});
    }
    return plot.series.size() < 2 ? "" : line_plot(plot);
}

std::string level_plot(const std::vector<BuildRow>& rows) {
    LinePlot plot;
    plot.title = "Nodes on each level";
    plot.x_label = "level, the root is 0";
    plot.y_label = "nodes (log scale)";
    plot.y_scale = LinePlot::Scale::log;
    for (const BuildRow& row : rows) {
        const std::vector<double> nodes = numbers_at(*row.build, "nodes_per_level");
        if (nodes.empty()) continue;
        const int number = static_cast<int>(plot.series.size());
        Series series{.name = row.scene + ", " + row.name,
                      .x = {},
                      .y = nodes,
                      .colour = number,
                      .dash = number / palette_size,
                      .shape = number};
        for (std::size_t i = 0; i < nodes.size(); ++i) series.x.push_back(static_cast<double>(i));
        plot.series.push_back(series);
    }
    return plot.series.empty() ? "" : line_plot(plot);
}

std::string time_table(const std::vector<BuildRow>& rows) {
    Table table{.title = "Build times",
                .origin = Origin::measured,
                .columns = {{"builder"},
                            {"scene"},
                            {"tree"},
                            {"bits", Format::integer},
                            {"leaves of", Format::integer},
                            {"reinsertion", Format::integer, "rounds"},
                            {"layout"},
                            {"device"},
                            {"total", Format::number, "ms, median"},
                            {"least", Format::number, "ms"},
                            {"most", Format::number, "ms"},
                            {"to the fastest", Format::ratio, "of the scene"},
                            {"into kept memory", Format::number, "ms, median"},
                            {"rate", Format::number, "M primitives/s"},
                            {"loading", Format::number, "ms"},
                            {"document"}}};
    for (const BuildRow& row : rows) {
        if (!row.total) continue;
        double fastest = *row.total;
        for (const BuildRow& other : rows)
            if (other.scene == row.scene && other.total) fastest = std::min(fastest, *other.total);
        std::optional<double> ratio, rate;
        if (fastest > 0) ratio = *row.total / fastest;
        if (row.primitives && *row.total > 0) rate = *row.primitives / *row.total / 1e3;
        table.rows.push_back(
            {text_at(*row.build, "builder"), row.scene, text_at(*row.build, "tree"),
             number_at(*row.build, "bits"), number_at(*row.build, "max_leaf"),
             number_at(*row.build, "reinsertion_rounds"), text_at(*row.build, "layout"), row.device,
             row.total, row.low, row.high, ratio, spread_at(*row.build, "kept_ms").median, rate,
             number_at(row.document->root, "load_ms"), row.document->name});
    }
    table.drop_empty_columns();
    return table_html(table);
}

std::string tree_table(const std::vector<BuildRow>& trees) {
    Table table{.title = "The trees",
                .note =
                    "SAH and EPO are costs that a model gives, counted over the real tree. A tree "
                    "hash stands for every node, box and leaf: equal hashes, equal trees.",
                .columns = {{"builder"},
                            {"scene"},
                            {"tree"},
                            {"bits", Format::integer},
                            {"leaves of", Format::integer},
                            {"reinsertion", Format::integer, "rounds"},
                            {"layout"},
                            {"device"},
                            {"primitives", Format::integer},
                            {"left out", Format::integer},
                            {"nodes", Format::integer},
                            {"leaves", Format::integer},
                            {"references", Format::integer},
                            {"depth", Format::integer},
                            {"proven bound", Format::integer},
                            {"SAH", Format::number},
                            {"EPO", Format::number},
                            {"size", Format::number, "MB"},
                            {"each primitive", Format::number, "bytes"},
                            {"peak", Format::number, "MB, building"},
                            {"tree hash"}}};
    for (const BuildRow& row : trees) {
        const Json& b = *row.build;
        const auto mega = [&](const char* field) -> std::optional<double> {
            const auto bytes = number_at(b, field);
            return bytes ? std::optional(*bytes / 1e6) : std::nullopt;
        };
        std::optional<double> each;
        if (const auto bytes = number_at(b, "bytes"); bytes && row.primitives.value_or(0) > 0)
            each = *bytes / *row.primitives;
        Cell hash(shortened(text_at(b, "tree_hash"), 11));
        hash.tip = text_at(b, "tree_hash");
        table.rows.push_back({text_at(b, "builder"),
                              row.scene,
                              text_at(b, "tree"),
                              number_at(b, "bits"),
                              number_at(b, "max_leaf"),
                              number_at(b, "reinsertion_rounds"),
                              text_at(b, "layout"),
                              row.device,
                              row.primitives,
                              number_at(b, "left_out"),
                              number_at(b, "nodes"),
                              number_at(b, "leaves"),
                              number_at(b, "references"),
                              number_at(b, "max_depth"),
                              number_at(b, "depth_bound"),
                              row.sah,
                              number_at(b, "epo"),
                              mega("bytes"),
                              each,
                              mega("peak_bytes"),
                              hash});
    }
    table.drop_empty_columns();
    return table_html(table);
}

/// Figures of layouts other than the binary one; "" if there are none.
std::string layout_table(const std::vector<BuildRow>& trees) {
    Table table{.title = "Wide layouts",
                .note =
                    "What rays go through where the layout is not binary. Times are medians, from "
                    "the mesh to the layout. SAH is 1 a node and 0.4 a triangle, of cwbvh 1 and 1.",
                .columns = {{"tree"},
                            {"scene"},
                            {"layout"},
                            {"nodes", Format::integer},
                            {"leaves", Format::integer},
                            {"references", Format::integer},
                            {"depth", Format::integer},
                            {"children", Format::number, "per node"},
                            {"SAH", Format::number},
                            {"boxes widened", Format::ratio, "of their area"},
                            {"nodes", Format::number, "MB"},
                            {"triangles", Format::number, "MB"},
                            {"build", Format::number, "ms", Origin::measured},
                            {"into kept memory", Format::number, "ms", Origin::measured},
                            {"layout alone", Format::number, "ms", Origin::measured},
                            {"binary tree alone", Format::number, "ms", Origin::measured}}};
    for (const BuildRow& row : trees)
        for (const char* field : {"wide", "cwbvh"}) {
            const Json& w = at(*row.build, field);
            if (!w.is_object()) continue;
            const bool is_wide = std::string(field) == "wide";
            const auto mega = [&](const char* name) -> std::optional<double> {
                const auto bytes = number_at(w, name);
                return bytes ? std::optional(*bytes / 1e6) : std::nullopt;
            };
            table.rows.push_back(
                {row.name, row.scene, text_at(*row.build, "layout"), number_at(w, "nodes"),
                 number_at(w, "leaves"), number_at(w, "references"), number_at(w, "max_depth"),
                 number_at(w, "children_per_node"), number_at(w, "sah"), number_at(w, "widening"),
                 mega("node_bytes"), mega("triangle_bytes"),
                 is_wide ? spread_at(w, "build_ms").median : row.total,
                 spread_at(is_wide ? w : *row.build, "kept_ms").median,
                 number_at(w, is_wide ? "layout_ms" : "ms"),
                 number_at(*row.build, "binary.ms.total")});
        }
    table.drop_empty_columns();
    return table_html(table);
}

void say_times(const std::string& scene, const std::vector<BuildRow>& rows, Section& section) {
    std::vector<BuildRow> timed;
    for (const BuildRow& row : rows)
        if (row.total) timed.push_back(row);
    if (timed.empty()) return;
    const auto [fast, slow] =
        std::ranges::minmax(timed, {}, [](const BuildRow& r) { return *r.total; });
    const auto ms = [](const BuildRow& row) { return strong(significant(*row.total), "ms"); };
    std::string said = "Measured on " + escaped(machine_text(*fast.document)) + ": ";
    const std::string what = breakable(with_settings(fast));
    if (timed.size() == 1)
        said += fmt::format("{} builds the tree of {} in {}", strong(fast.name), what, ms(fast));
    else
        said += fmt::format(
            "of {} builds of {}, the fastest is {} with {}, the slowest {} with {}, {} times as "
            "long",
            timed.size(), what, strong(fast.name), ms(fast), strong(slow.name), ms(slow),
            significant(*slow.total / *fast.total));
    if (fast.primitives && *fast.total > 0)
        said += fmt::format(" ({} million primitives a second{})",
                            significant(*fast.primitives / *fast.total / 1e3),
                            timed.size() == 1 ? "" : " for the fastest");
    section.summary.push_back(said + ".");
    section.tiles.push_back({significant(*fast.total), "ms",
                             "fastest build of " + scene + ": " + fast.name,
                             badge(Origin::measured)});
}

/// Of the trees in the table.
void say_quality(const std::string& scene, const std::vector<BuildRow>& trees, Section& section) {
    std::vector<BuildRow> rated;
    std::map<std::string, std::vector<std::string>> same;
    std::set<Json> constants;
    for (const BuildRow& row : trees) {
        if (row.sah) constants.insert(at(*row.build, "sah_constants"));
        if (row.sah) rated.push_back(row);
        if (const std::string hash = text_at(*row.build, "tree_hash"); !hash.empty())
            same[hash].push_back(row.name);
    }
    if (rated.size() > 1 && constants.size() == 1) {  // other constants, another unit
        const auto [low, high] =
            std::ranges::minmax(rated, {}, [](const BuildRow& r) { return *r.sah; });
        if (*low.sah < *high.sah)
            section.summary.push_back(fmt::format(
                "The tree of {} with the lowest SAH cost, {}, is that of {}; the highest, "
                "{}, is that of {}.",
                breakable(scene), significant(*low.sah, 4), strong(low.name),
                significant(*high.sah, 4), escaped(high.name)));
    }
    for (const auto& [hash, names] : same)
        if (names.size() > 1)
            section.summary.push_back(fmt::format(
                "{} give the same tree of {}, bit for bit (hash "
                "{}).",
                escaped(listed(names)), breakable(scene), escaped(shortened(hash, 11))));
}

}  // namespace

std::vector<std::string> tree_settings(const Json& build) {
    std::vector<std::string> settings(4);
    if (const auto bits = number_at(build, "bits")) settings[0] = fmt::format("{:.0f} bits", *bits);
    if (const auto leaf = number_at(build, "max_leaf"))
        settings[1] = fmt::format("leaves of {:.0f}", *leaf);
    if (const auto rounds = number_at(build, "reinsertion_rounds"); rounds.value_or(0) > 0)
        settings[2] = counted(*rounds, "round") + " of reinsertion";
    const double node = number_at(build, "sah_constants.node").value_or(1),
                 primitive = number_at(build, "sah_constants.primitive").value_or(1);
    if (node != 1 || primitive != 1)
        settings[3] = fmt::format("SAH costs {:g} and {:g}", node, primitive);
    return settings;
}

Section build_section(const Documents& documents, PageColours& colours) {
    Section section{.id = "builds", .title = "Builds"};
    const std::vector<BuildRow> all = rows_of(documents);
    std::vector<BuildRow> built = all;
    std::erase_if(built, [](const BuildRow& row) { return row.document->command != "build"; });
    name_rows(built, Layouts::apart);
    std::string plots;
    for (const std::string& scene : scenes_of(built)) {
        const std::vector<BuildRow> rows = rows_of_scene(built, scene);
        plots += stage_plot(rows, colours) + quality_plot(rows, colours);
        say_times(scene, rows, section);
    }
    // Costs and hashes are those of the binary tree, whatever the layout.
    const std::vector<BuildRow> trees = different_trees(all, Layouts::together),
                                laid_out = different_trees(all, Layouts::apart);
    for (const std::string& scene : scenes_of(trees))
        say_quality(scene, rows_of_scene(trees, scene), section);
    plots += level_plot(built);
    if (!plots.empty()) section.html = "<div class=\"plots\">" + plots + "</div>\n";
    section.html += time_table(built) + tree_table(laid_out) + layout_table(laid_out);
    return section;
}

}  // namespace raydix::report
