// Documents of `mpi bench` -> what was counted over numbers of ranks, what was predicted of it, and
// modelled curves: queries forwarded to the ranks that they reach, beside every query to every
// rank.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "report/html.h"
#include "report/line_plot.h"
#include "report/number_text.h"
#include "report/sections.h"
#include "report/table.h"

namespace raydix::report {
namespace {

using Format = Column::Format;

/// "1,000,000 points and 100,000 queries a rank, uniform, mixed, curve, k 8"
std::string settings_of(const Document& document, bool weak) {
    std::string text = fmt::format(
        "{} points and {} queries {}", with_decimals(or_nan(number_at(document.root, "points")), 0),
        with_decimals(or_nan(number_at(document.root, "queries")), 0), weak ? "a rank" : "in all");
    for (const char* field : {"cloud", "given", "partition"})
        if (const std::string value = text_at(document.root, field); !value.empty())
            text += ", " + value;
    if (const auto k = number_at(document.root, "k")) text += ", k " + with_decimals(*k, 0);
    return text;
}

Series series_of(const std::vector<const Json*>& rows, const std::string& name, const char* field,
                 int colour, int dash = 0) {
    Series series{.name = name, .x = {}, .y = {}, .colour = colour, .dash = dash, .shape = colour};
    for (const Json* row : rows) {
        series.x.push_back(or_nan(number_at(*row, "ranks")));
        series.y.push_back(or_nan(number_at(*row, field)));
    }
    return series;
}

LinePlot plot_over_ranks(const std::string& title, Origin origin) {
    LinePlot plot;
    plot.title = title;
    plot.x_label = "ranks (log scale)";
    plot.x_unit = "ranks";
    plot.x_scale = LinePlot::Scale::log;
    plot.origin = origin;
    return plot;
}

std::string measured_plot(const Document& document, const std::vector<const Json*>& counted) {
    LinePlot plot = plot_over_ranks("Compute of the slowest rank", Origin::measured);
    plot.note =
        "Processor seconds of a call, within stretches in which a rank computes. At most as many "
        "ranks compute at a time as there are processors. The line is one rank's.";
    if (const auto alone = number_at(document.root, "alone_compute_s_most"))
        plot.note +=
            fmt::format(" With every rank alone at the same time it is {} s.", significant(*alone));
    plot.y_label = "processor seconds";
    plot.y_unit = "s";
    plot.x_scale = LinePlot::Scale::log_at_points;
    plot.series = {series_of(counted, "nearest points", "knn_compute_s_most", 0)};
    if (!counted.empty()) plot.reference = or_nan(number_at(*counted[0], "knn_compute_s_most"));
    plot.with_legend = false;
    return counted.empty() ? "" : line_plot(plot);
}

std::string modelled_plots(const Document& document, const std::vector<const Json*>& rows) {
    if (rows.empty()) return {};
    LinePlot time = plot_over_ranks("Time of a call", Origin::modelled);
    time.note = fmt::format(
        "What was counted, continued over the logarithm of ranks; {} microseconds a message and {} "
        "bytes a second are chosen, not measured.",
        significant(1e6 * or_nan(number_at(document.root, "model.latency_s"))),
        short_number(or_nan(number_at(document.root, "model.bytes_per_s"))));
    time.y_label = "seconds (log scale)";
    time.y_unit = "s";
    time.y_scale = LinePlot::Scale::log;
    time.series = {series_of(rows, "forwarding", "forwarding_s", 0),
                   series_of(rows, "its slowest rank's compute", "forwarding_compute_s", 0, 1),
                   series_of(rows, "every query to every rank", "broadcast_s", 1)};
    LinePlot bytes = plot_over_ranks("Bytes that all ranks send", Origin::modelled);
    bytes.y_label = "bytes (log scale)";
    bytes.y_unit = "bytes";
    bytes.y_scale = LinePlot::Scale::log;
    bytes.series = {series_of(rows, "forwarding", "forwarding_bytes", 0),
                    series_of(rows, "every query to every rank", "broadcast_bytes", 1)};
    return line_plot(time) + line_plot(bytes);
}

struct Figure {
    const char *title, *field;
    Format format;
    const char* unit;
    bool is_predicted;
};
constexpr Figure figures[] = {
    {"compute", "knn_compute_s_most", Format::number, "s, slowest rank", true},
    {"build", "build_compute_s_most", Format::number, "s, slowest rank", false},
    {"imbalance", "imbalance", Format::mixed, "most points / mean", false},
    {"rounds", "rounds", Format::integer, "", true},
    {"messages", "messages", Format::integer, "", true},
    {"bytes", "bytes", Format::integer, "", true},
    {"ranks asked", "ranks_touched", Format::mixed, "a query", true},
    {"in two rounds", "two_round_ranks_touched", Format::mixed, "a query", false},
    {"to every rank", "broadcast_bytes", Format::integer, "bytes", false},
    {"replicated", "replicated_bytes", Format::integer, "bytes", true},
    {"memory", "bytes_per_rank_most", Format::integer, "bytes of a rank", false},
};

std::string counted_table(const std::vector<const Json*>& counted) {
    Table table{.title = "Counted",
                .note =
                    "\xE2\x80\x9CIn two rounds\xE2\x80\x9D: the nearest rank, then all that its "
                    "answer leaves, itself again. \xE2\x80\x9CTo every rank\xE2\x80\x9D: bytes "
                    "if every query went to all.",
                .origin = Origin::measured,
                .columns = {{"ranks", Format::integer}}};
    for (const Figure& figure : figures)
        table.columns.push_back({figure.title, figure.format, figure.unit});
    for (const Json* row : counted) {
        table.rows.push_back({number_at(*row, "ranks")});
        for (const Figure& figure : figures)
            table.rows.back().push_back(number_at(*row, figure.field));
    }
    table.drop_empty_columns();
    return table_html(table);
}

std::string predicted_table(const Document& document, const std::vector<const Json*>& counted) {
    const Json& predicted = at(document.root, "predicted");
    if (counted.empty() || !predicted.is_object()) return {};
    Table table{.title = fmt::format("Predicted for {} ranks from at most 8",
                                     with_decimals(or_nan(number_at(predicted, "ranks")), 0)),
                .note = "A deviation above 20 % is marked.",
                .columns = {{"figure"},
                            {"predicted", Format::mixed, "", Origin::modelled},
                            {"counted", Format::mixed, "", Origin::measured},
                            {"predicted / counted", Format::ratio}}};
    for (const Figure& figure : figures) {
        const auto foretold = number_at(predicted, figure.field),
                   found = number_at(*counted.back(), figure.field);
        if (!figure.is_predicted || !foretold || !found || *found == 0) continue;
        Cell ratio(*foretold / *found);
        if (std::fabs(*ratio.value - 1) > 0.2) ratio.mark = Cell::Mark::alert;
        table.rows.push_back({figure.title, foretold, found, ratio});
    }
    return table_html(table);
}

/// Numbers of ranks at which the faster of two ways changes, between rows on a log scale.
std::vector<double> crossings(const std::vector<const Json*>& rows) {
    std::vector<double> found;
    double last_ranks = 0, last = 0;
    for (const Json* row : rows) {
        const double ranks = or_nan(number_at(*row, "ranks")),
                     lead = std::log(or_nan(number_at(*row, "broadcast_s")) /
                                     or_nan(number_at(*row, "forwarding_s")));
        if (!(ranks > 0) || !std::isfinite(lead)) continue;
        if (last * lead < 0)
            found.push_back(last_ranks * std::pow(ranks / last_ranks, last / (last - lead)));
        last_ranks = ranks;
        last = lead;
    }
    return found;
}

void say_modelled(const std::vector<const Json*>& rows, const std::string& what, Section& section) {
    if (rows.empty()) return;
    const double most = or_nan(number_at(*rows.back(), "ranks")),
                 least = or_nan(number_at(*rows.front(), "ranks")),
                 lead = or_nan(number_at(*rows.back(), "broadcast_s")) /
                        or_nan(number_at(*rows.back(), "forwarding_s"));
    if (!std::isfinite(lead)) return;
    std::vector<std::string> places;
    for (const double ranks : crossings(rows)) places.push_back(significant(ranks, 2));
    const std::string ahead = lead > 1 ? "forwarding queries to the ranks that they reach"
                                       : "sending every query to every rank";
    section.summary.push_back(fmt::format(
        "{} {}: {} takes less time {}; on {} ranks the other way takes {} times as long.",
        badge(Origin::modelled), escaped(what), ahead,
        places.empty() ? fmt::format("for every number from {} on", with_decimals(least, 0))
                       : fmt::format("beyond the crossing{} at about {} ranks",
                                     places.size() == 1 ? "" : "s", listed(places)),
        with_decimals(most, 0), significant(lead > 1 ? lead : 1 / lead)));
}

void say_counted(const std::vector<const Json*>& counted, const std::string& what,
                 Section& section) {
    if (counted.size() < 2) return;
    const Json &one = *counted.front(), &all = *counted.back();
    const double ratio =
        or_nan(number_at(all, "knn_compute_s_most")) / or_nan(number_at(one, "knn_compute_s_most"));
    if (!std::isfinite(ratio)) return;
    section.summary.push_back(fmt::format(
        "{} {}: the slowest of {} ranks computes {} times as long as one rank; a query asks {} "
        "ranks.",
        badge(Origin::measured), escaped(what), with_decimals(or_nan(number_at(all, "ranks")), 0),
        strong(significant(ratio)), strong(significant(or_nan(number_at(all, "ranks_touched"))))));
}

}  // namespace

Section ranks_section(const Documents& documents) {
    Section section{.id = "ranks", .title = "Over ranks"};
    for (const Document& document : documents) {
        const bool weak = document.command == "mpi bench weak";
        if (!weak && document.command != "mpi bench strong") continue;
        const auto counted = objects_at(document.root, "counted"),
                   modelled = objects_at(document.root, "modelled");
        const std::string what = settings_of(document, weak);
        section.html += fmt::format("<h3>{}</h3>\n", breakable(what));
        const std::string plots =
            modelled_plots(document, modelled) + measured_plot(document, counted);
        if (!plots.empty()) section.html += "<div class=\"plots\">" + plots + "</div>\n";
        section.html += counted_table(counted) + predicted_table(document, counted);
        say_counted(counted, what, section);
        say_modelled(modelled, what, section);
    }
    return section;
}

}  // namespace raydix::report
