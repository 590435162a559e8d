// Documents of `bench traversal` -> measured beside simulated and published figures, the paper's
// claims, and what the width of a warp changes.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "report/bar_plot.h"
#include "report/html.h"
#include "report/line_plot.h"
#include "report/number_text.h"
#include "report/sections.h"
#include "report/simulate_rows.h"
#include "report/svg.h"
#include "report/table.h"

namespace raydix::report {
namespace {

using Format = Column::Format;

std::string claim_table(const std::vector<const Json*>& claims) {
    Table table{.title = "The paper's claims",
                .note =
                    "Found: the ratio with the error of the sample and of the costs. A claim "
                    "holds if all of that lies in the paper's interval, and does not if none "
                    "of it does. Else it is open.",
                .columns = {{"claim"}, {"here"}, {"the paper"}, {"found"}, {"scene"}}};
    for (const Json* claim : claims) {
        const Json& holds = at(*claim, "holds");
        // Open, or what it would take to say more.
        Cell verdict(text_at(*claim, "verdict").empty() ? "open" : text_at(*claim, "verdict"));
        verdict.mark = Cell::Mark::even;
        if (holds.is_boolean()) {
            verdict.text = holds.get<bool>() ? "\xE2\x9C\x93 holds" : "\xE2\x9C\x97 does not hold";
            verdict.mark = holds.get<bool>() ? Cell::Mark::better : Cell::Mark::worse;
        }
        table.rows.push_back({text_at(*claim, "claim"), verdict, text_at(*claim, "paper"),
                              text_at(*claim, "found"), text_at(*claim, "scene")});
    }
    return table_html(table);
}

struct MeasuredRow {
    std::string scene, kernel, rays, device;
    SpreadFields rate;
    std::optional<double> part;   // of the lowest simulated limit, 0..1
    std::optional<double> bound;  // by issue alone

    [[nodiscard]] bool above_bound() const { return rate.median && bound && *rate.median > *bound; }
};

std::vector<MeasuredRow> measured_rows(const Documents& documents) {
    std::vector<MeasuredRow> rows;
    for (const Document& document : documents)
        for (const Json* m : objects_at(document.root, "measured")) {
            auto part = number_at(*m, "percent_of_simulated");
            if (part) *part /= 100;
            rows.push_back({text_at(*m, "scene"), text_at(*m, "kernel"), text_at(*m, "rays"),
                            text_at(*m, "device"), spread_at(*m, "mrays_per_s"), part,
                            number_at(*m, "mrays_per_s_bound")});
        }
    return rows;
}

/// The limit that the measured figure was compared with: rate / part.
double limit_of(const MeasuredRow& row) {
    return row.rate.median && row.part && *row.part > 0 ? *row.rate.median / *row.part : Bar::none;
}

std::string measured_table(const std::vector<MeasuredRow>& rows) {
    Table table{
        .title = "Measured beside simulated",
        .note =
            "The limit is the lower of the issue bound and what memory allows, where that was "
            "asked for. A measured rate above the bound would mean that the model is wrong; above "
            "the limit alone, that the estimated clocks and rates of memory are.",
        .columns = {{"kernel"},
                    {"scene"},
                    {"rays"},
                    {"device"},
                    {"rate", Format::number, "Mrays/s, median", Origin::measured},
                    {"least", Format::number, "Mrays/s", Origin::measured},
                    {"most", Format::number, "Mrays/s", Origin::measured},
                    {"bound", Format::number, "Mrays/s", Origin::simulated},
                    {"limit", Format::number, "Mrays/s", Origin::simulated},
                    {"measured of the limit", Format::percent}}};
    for (const MeasuredRow& row : rows) {
        Cell part(row.part);
        if (row.above_bound() || (row.part && *row.part > 1)) {
            part.mark = Cell::Mark::alert;
            part.text = row.above_bound() ? "above the bound" : "above the limit";
        }
        table.rows.push_back({row.kernel, row.scene, row.rays, row.device, row.rate.median,
                              row.rate.min, row.rate.max, row.bound, limit_of(row), part});
    }
    table.drop_empty_columns();
    return table_html(table);
}

std::string measured_plots(const std::vector<MeasuredRow>& rows) {
    std::vector<std::pair<std::string, std::string>> groups;  // scene, rays
    for (const MeasuredRow& row : rows)
        if (std::ranges::find(groups, std::pair(row.scene, row.rays)) == groups.end())
            groups.emplace_back(row.scene, row.rays);
    std::string plots;
    for (const auto& [scene, rays] : groups) {
        BarPlot plot{.title = "Measured, " + rays + " rays",
                     .subtitle = scene,
                     .label = "rate, Mrays/s",
                     .unit = "Mrays/s",
                     .origin = Origin::measured,
                     .parts = {{"measured", 0}},
                     .limit_name = "lowest limit (simulated)"};
        for (const MeasuredRow& row : rows)
            if (row.scene == scene && row.rays == rays)
                plot.bars.push_back({.label = row.kernel,
                                     .parts = {or_nan(row.rate.median)},
                                     .low = or_nan(row.rate.min),
                                     .high = or_nan(row.rate.max),
                                     .limit = limit_of(row),
                                     .note = row.part ? percent(*row.part) : ""});
        plots += bar_plot(plot);
    }
    return plots;
}

struct PublishedRow {
    std::string scene, kernel, rays, machine;
    std::optional<double> rate, simulated;
    bool other_edition = false;
    std::optional<double> tightest;  // of all limits
    std::string limit = {};          // which one that is
    double error = 0;                // relative standard error of `simulated`

    /// Beyond what the sample leaves open.
    [[nodiscard]] bool above_bound() const {
        return rate && simulated && *rate > *simulated * (1 + 2 * error);
    }
};

/// Of several simulated rows, that of the least error.
void put_bound_beside(PublishedRow& row, const std::vector<SimulatedRow>& simulated) {
    for (const SimulatedRow& s : simulated) {
        if (std::tie(s.scene, s.kernel, s.rays, s.machine) !=
            std::tie(row.scene, row.kernel, row.rays, row.machine))
            continue;
        const double error = s.error.value_or(s.part.value_or(1) < 1 ? 1 : 0);
        if (row.simulated && error >= row.error) continue;
        row.simulated = s.bound;
        row.error = error;
    }
}

/// Documents may repeat what was published: each row once, with the tightest limit that is known.
std::vector<PublishedRow> published_rows(const Documents& documents) {
    const std::vector<SimulatedRow> simulated = simulated_rows(documents);
    std::vector<PublishedRow> rows;
    for (const Document& document : documents)
        for (const Json* p : objects_at(document.root, "published")) {
            PublishedRow row{text_at(*p, "scene"),
                             text_at(*p, "kernel"),
                             text_at(*p, "rays"),
                             text_at(*p, "machine"),
                             spread_at(*p, "mrays_per_s").median,
                             {},
                             text_at(*p, "other_edition") == "yes",
                             number_at(*p, "mrays_per_s_tightest"),
                             text_at(*p, "tightest_limit")};
            put_bound_beside(row, simulated);
            const auto known = std::ranges::find_if(rows, [&](const PublishedRow& other) {
                return std::tie(other.scene, other.kernel, other.rays, other.machine) ==
                       std::tie(row.scene, row.kernel, row.rays, row.machine);
            });
            if (known == rows.end())
                rows.push_back(row);
            else if (row.tightest && (!known->tightest || *row.tightest < *known->tightest))
                *known = row;
        }
    return rows;
}

/// A figure over the largest of its scene, rays and machine among kernels that have both.
std::optional<double> of_best(const std::vector<PublishedRow>& rows, const PublishedRow& row,
                              std::optional<double> PublishedRow::*field) {
    double best = 0;
    for (const PublishedRow& other : rows)
        if (other.rate && other.simulated &&
            std::tie(other.scene, other.rays, other.machine) ==
                std::tie(row.scene, row.rays, row.machine))
            best = std::max(best, *(other.*field));
    if (!row.rate || !row.simulated || best <= 0) return std::nullopt;
    return *(row.*field) / best;
}

/// Published over simulated; marked where it is above the bound.
Cell part_of_bound(const PublishedRow& row) {
    if (!row.rate || !row.simulated || *row.simulated <= 0) return {};
    Cell part(*row.rate / *row.simulated);
    if (row.above_bound()) {
        part.mark = Cell::Mark::alert;
        part.text = "above the bound";
    } else if (*part.value > 1) {
        part.text = "above, within the error";
    }
    return part;
}

std::string published_table(const std::vector<PublishedRow>& rows) {
    const bool other = std::ranges::any_of(rows, &PublishedRow::other_edition);
    Table table{.title = "Published beside simulated",
                .note = other
                            ? "Scenes marked \xE2\x80\x9Cother edition\xE2\x80\x9D are not the "
                              "paper's files: compare what a kernel has of the best kernel, not "
                              "the rates themselves. A published rate above the simulated bound is "
                              "marked: the scene, the tree or a cost of the model differs from "
                              "the authors'."
                            : "",
                .columns = {{"kernel"},
                            {"scene"},
                            {"rays"},
                            {"machine"},
                            {"published", Format::number, "Mrays/s", Origin::published},
                            {"bound", Format::number, "Mrays/s", Origin::simulated},
                            {"published of the bound", Format::percent},
                            {"tightest limit", Format::number, "Mrays/s", Origin::simulated},
                            {"which limit"},
                            {"published of the tightest", Format::percent},
                            {"of the best kernel", Format::percent, "", Origin::published},
                            {"of the best kernel", Format::percent, "", Origin::simulated},
                            {"scene's edition"}}};
    for (const PublishedRow& row : rows)
        table.rows.push_back(
            {row.kernel, row.scene, row.rays, row.machine, row.rate, row.simulated,
             part_of_bound(row), row.tightest, row.limit,
             row.rate && row.tightest ? std::optional(*row.rate / *row.tightest) : std::nullopt,
             of_best(rows, row, &PublishedRow::rate), of_best(rows, row, &PublishedRow::simulated),
             row.other_edition ? "other edition" : "the paper's"});
    table.drop_empty_columns();
    return table_html(table);
}

/// Panels of scene, rays and machine; a line for each kernel.
std::string width_plots(const Documents& documents, PageColours& colours) {
    std::map<std::tuple<std::string, std::string, std::string>, std::vector<const Json*>> panels;
    for (const Document& document : documents)
        for (const Json* row : objects_at(document.root, "width_sweep"))
            panels[{text_at(*row, "machine"), text_at(*row, "scene"), text_at(*row, "rays")}]
                .push_back(row);
    std::string plots;
    for (const auto& [key, rows] : panels) {
        const auto& [machine, scene, rays] = key;
        LinePlot efficiency;
        efficiency.title = "Width of a warp, " + rays + " rays";
        efficiency.subtitle = scene + " on " + machine;
        efficiency.x_label = "lanes of a warp (log scale)";
        efficiency.y_label = "SIMD efficiency, %";
        efficiency.x_unit = "lanes";
        efficiency.y_unit = "%";
        efficiency.x_scale = LinePlot::Scale::log_at_points;
        efficiency.origin = Origin::simulated;
        LinePlot bound = efficiency;
        bound.y_label = "upper bound, Mrays/s (log scale)";
        bound.y_unit = "Mrays/s";
        bound.y_scale = LinePlot::Scale::log;
        std::map<std::string, std::vector<const Json*>> lines;
        for (const Json* row : rows) lines[text_at(*row, "kernel")].push_back(row);
        for (auto& [kernel, points] : lines) {
            std::ranges::stable_sort(
                points, {}, [](const Json* p) { return number_at(*p, "width").value_or(0); });
            const int colour = colours.kernels.of(kernel);
            Series series{.name = kernel,
                          .x = {},
                          .y = {},
                          .colour = colour,
                          .dash = colour / palette_size,
                          .shape = colour};
            for (const Json* p : points) {
                series.x.push_back(or_nan(number_at(*p, "width")));
                series.y.push_back(100 * or_nan(number_at(*p, "simd_efficiency")));
            }
            efficiency.series.push_back(series);
            series.y.clear();
            for (const Json* p : points)
                series.y.push_back(or_nan(spread_at(*p, "mrays_per_s_bound").median));
            bound.series.push_back(series);
        }
        plots += line_plot(efficiency) + line_plot(bound);
    }
    return plots;
}

/// "1.02 (0.98 to 1.06)", or what it takes to know the error
std::string ahead_text(const Json& kernel) {
    const auto low = number_at(kernel, "low"), high = number_at(kernel, "high");
    return fmt::format(
        "{} ({})", with_decimals(or_nan(number_at(kernel, "first_over_it")), 2),
        low && high ? fmt::format("{} to {}", with_decimals(*low, 2), with_decimals(*high, 2))
                    : text_at(kernel, "needs"));
}

/// The fastest kernel of each machine and kind of rays, and those that are not told from it.
std::string ranking_table(const Documents& documents) {
    Table table{.title = "Which kernel",
                .note =
                    "Highest of the tightest limits. Not told from it: kernels that may be as "
                    "fast within two standard errors of the sample and the derived range of "
                    "costs; in brackets by how much it is above them, with that error.",
                .origin = Origin::simulated,
                .columns = {{"scene"},
                            {"machine"},
                            {"rays"},
                            {"kernel"},
                            {"rate", Format::number, "Mrays/s", Origin::simulated},
                            {"limit"},
                            {"not told from it"}}};
    for (const Document& document : documents)
        for (const Json* row : objects_at(document.root, "ranking")) {
            const auto kernels = objects_at(*row, "kernels");
            if (kernels.empty()) continue;
            std::vector<std::string> level;
            for (std::size_t k = 1; k < kernels.size(); ++k) {
                const Json& behind = at(*kernels[k], "behind");
                if (behind.is_boolean() && behind.get<bool>()) continue;
                level.push_back(text_at(*kernels[k], "kernel") + " " + ahead_text(*kernels[k]));
            }
            table.rows.push_back(
                {text_at(*row, "scene"), text_at(*row, "machine"), text_at(*row, "rays"),
                 text_at(*kernels[0], "kernel"), number_at(*kernels[0], "mrays_per_s"),
                 text_at(*kernels[0], "limit"),
                 level.empty() ? "none" : fmt::format("{}", fmt::join(level, ", "))});
        }
    return table.rows.empty() ? "" : table_html(table);
}

void say_claims(const std::vector<const Json*>& claims, Section& section) {
    if (claims.empty()) return;
    constexpr std::string_view needs = "needs ";
    std::size_t hold = 0, fail = 0, open = 0;
    std::map<std::string, std::size_t> needing;  // what there is no verdict without
    for (const Json* claim : claims) {
        const Json& holds = at(*claim, "holds");
        const std::string verdict = text_at(*claim, "verdict");
        if (holds.is_boolean())
            ++(holds.get<bool>() ? hold : fail);
        else if (verdict.starts_with(needs))
            ++needing[verdict.substr(needs.size())];
        else
            ++open;
    }
    std::vector<std::string> without;
    for (const auto& [what, count] : needing)
        without.push_back(fmt::format("{} need{} {}", count, count == 1 ? "s" : "", escaped(what)));
    const std::size_t judged = hold + fail + open;
    if (judged == 0) {
        section.summary.push_back(
            fmt::format("No claim of the paper has a verdict here: {}.", listed(without)));
        return;
    }
    section.summary.push_back(
        fmt::format("Of {} claims of the paper{}, {} here, {}{}{}.", judged,
                    without.empty() ? "" : " that have a verdict",
                    strong(fmt::format("{} {}", hold, hold == 1 ? "holds" : "hold")),
                    strong(fmt::format("{} {} not", fail, fail == 1 ? "does" : "do")),
                    open ? fmt::format(" and {} stay{} open", open, open == 1 ? "s" : "") : "",
                    without.empty() ? "" : "; " + listed(without)));
    section.tiles.push_back(
        {fmt::format("{} of {}", hold, judged), "", "claims of the paper hold here", ""});
}

void say_published(const std::vector<PublishedRow>& rows, Section& section) {
    const auto above =
        std::ranges::count_if(rows, [](const PublishedRow& row) { return row.above_bound(); });
    if (above > 0)
        section.summary.push_back(
            fmt::format("<span class=\"warning\">{} published rate{} above the simulated bound, so "
                        "scene, tree or "
                        "model differ from the authors' there.</span>",
                        above, above == 1 ? " lies" : "s lie"));
}

void say_measured(const std::vector<MeasuredRow>& rows, Section& section) {
    std::vector<MeasuredRow> rated;
    for (const MeasuredRow& row : rows)
        if (row.part) rated.push_back(row);
    if (rated.empty()) {
        section.summary.push_back(
            rows.empty() ? "No kernel of this bench was run on a real GPU: all its rates are "
                           "simulated or published."
                         : "Measured rates are there, but none has a simulated limit beside it.");
        return;
    }
    const auto [low, high] =
        std::ranges::minmax(rated, {}, [](const MeasuredRow& row) { return *row.part; });
    section.summary.push_back(
        fmt::format("Measured rates reach {} to {} of their simulated limits; the nearest is {} "
                    "with {} rays on "
                    "{}.",
                    strong(percent(*low.part)), strong(percent(*high.part)), breakable(high.kernel),
                    escaped(high.rays), escaped(high.device)));
    if (std::ranges::any_of(rows, &MeasuredRow::above_bound))
        section.summary.push_back(
            "<span class=\"warning\">A measured rate lies above its simulated bound, so the model "
            "is wrong there.</span>");
}

}  // namespace

Section traversal_section(const Documents& documents, PageColours& colours) {
    Section section{.id = "traversal", .title = "Measured, simulated, published"};
    std::vector<const Json*> claims;
    bool benched = false;
    for (const Document& document : documents) {
        benched = benched || document.command == "bench traversal";
        for (const Json* claim : objects_at(document.root, "claims")) claims.push_back(claim);
    }
    const std::vector<MeasuredRow> measured = measured_rows(documents);
    section.html = claim_table(claims);
    std::string plots = measured_plots(measured);
    if (!plots.empty())
        section.html += "<h3>Measured and the bound</h3><div class=\"plots\">" + plots + "</div>\n";
    const std::vector<PublishedRow> published = published_rows(documents);
    section.html +=
        measured_table(measured) + published_table(published) + ranking_table(documents);
    say_published(published, section);
    plots = width_plots(documents, colours);
    if (!plots.empty())
        section.html += "<h3>Width of a warp " + badge(Origin::simulated) +
                        "</h3><div class=\"plots\">" + plots + "</div>\n";
    say_claims(claims, section);
    if (benched || !measured.empty()) say_measured(measured, section);
    return section;
}

}  // namespace raydix::report
