// The drawings as text: what is in them, and that odd input leaves no broken numbers in them.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <regex>
#include <string>
#include <vector>

#include "report/bar_plot.h"
#include "report/histogram_plot.h"
#include "report/line_plot.h"

namespace raydix::report {
namespace {

constexpr double no_value = std::numeric_limits<double>::quiet_NaN();
constexpr double no_end = std::numeric_limits<double>::infinity();

std::size_t count(const std::string& text, const std::string& part) {
    std::size_t found = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
        ++found;
    return found;
}

/// Every coordinate is a number within reach of the frame, and all that opens closes.
void expect_sound(const std::string& html) {
    const std::regex path(" d=\"([^\"]*)\"");
    for (std::sregex_iterator it(html.begin(), html.end(), path), end; it != end; ++it)
        EXPECT_EQ((*it)[1].str().find_first_not_of("MLZ0123456789.- "), std::string::npos)
            << it->str();
    EXPECT_EQ(count(html, "<g"), count(html, "</g>"));
    EXPECT_EQ(count(html, "<svg"), count(html, "</svg>"));
    EXPECT_EQ(count(html, "<figure"), count(html, "</figure>"));
    const std::regex attribute(" (x|y|x1|x2|y1|y2|width|height|cx|cy)=\"([^\"]*)\"");
    for (std::sregex_iterator it(html.begin(), html.end(), attribute), end; it != end; ++it) {
        EXPECT_EQ((*it)[2].str().find_first_not_of("0123456789.-"), std::string::npos) << it->str();
        const double v = std::stod((*it)[2]);
        EXPECT_GE(v, -20) << it->str();
        EXPECT_LE(v, 1000) << it->str();
    }
}

LinePlot line_of(std::vector<double> x, std::vector<double> y) {
    LinePlot plot;
    plot.title = "T";
    plot.x_label = "size, keys";
    plot.y_label = "time, ms";
    plot.series = {{.name = "a", .x = std::move(x), .y = std::move(y)}};
    return plot;
}

TEST(LinePlot, DrawsPointsTooltipsAndLabels) {
    const std::string html = line_plot(line_of({1, 2, 3}, {10, 20, 15}));
    expect_sound(html);
    EXPECT_EQ(count(html, "<title>"), 3u);
    EXPECT_EQ(count(html, "class=\"stroke"), 2u);  // the line and its legend
    EXPECT_NE(html.find("size, keys"), std::string::npos);
    EXPECT_NE(html.find("time, ms"), std::string::npos);
}

TEST(LinePlot, GapsWhereThereIsNoNumber) {
    const std::string html = line_plot(line_of({1, 2, 3, 4, 5}, {10, no_value, no_end, 20, 30}));
    expect_sound(html);
    EXPECT_EQ(count(html, "<title>"), 3u);
    const std::smatch path = [&] {
        std::smatch m;
        std::regex_search(html, m, std::regex("<path class=\"stroke[^\"]*\" d=\"([^\"]*)\""));
        return m;
    }();
    EXPECT_EQ(count(path[1], "M"), 2u);  // two pieces
    EXPECT_EQ(count(path[1], "L"), 1u);
}

TEST(LinePlot, LogAxesLeaveOutWhatTheyCannotShow) {
    LinePlot plot = line_of({1, 10, 100, 1000}, {0, -1, 5, 50});
    plot.x_scale = plot.y_scale = LinePlot::Scale::log;
    const std::string html = line_plot(plot);
    expect_sound(html);
    EXPECT_EQ(count(html, "<title>"), 2u);
}

TEST(LinePlot, OddSeries) {
    for (const auto scale :
         {LinePlot::Scale::linear, LinePlot::Scale::log, LinePlot::Scale::log_at_points})
        for (const std::vector<double>& y : {std::vector<double>{},
                                             {5},
                                             {no_value},
                                             {0, 0, 0},
                                             {7, 7, 7},
                                             {1e-30, 1e30},
                                             {-1e9, 1e9}}) {
            LinePlot plot = line_of({1, 2, 3}, y);  // lengths that differ, too
            plot.x_scale = plot.y_scale = scale;
            plot.diagonal = true;
            plot.reference = 1;
            expect_sound(line_plot(plot));
        }
    LinePlot none = line_of({}, {});
    none.series.clear();
    EXPECT_NE(line_plot(none).find("no figures to draw"), std::string::npos);
}

TEST(LinePlot, SaysWhatIsSimulatedEverywhere) {
    LinePlot plot = line_of({1, 2}, {3, 4});
    plot.origin = Origin::simulated;
    const std::string html = line_plot(plot);
    EXPECT_EQ(count(html, "badge simulated"), 1u);
    EXPECT_EQ(count(html, "(simulated)"), 3u);  // the axis and two tooltips
}

TEST(LinePlot, TextIsEscaped) {
    LinePlot plot = line_of({1}, {1});
    const std::string attack = "<script>\"'&";
    plot.title = plot.subtitle = plot.note = plot.x_label = plot.y_label = plot.series[0].name =
        attack;
    const std::string html = line_plot(plot);
    EXPECT_EQ(html.find("<script"), std::string::npos);
    EXPECT_GE(count(html, "&lt;script&gt;"), 7u);
}

BarPlot bars_of(std::vector<Bar> bars) {
    BarPlot plot;
    plot.title = "T";
    plot.label = "time, ms";
    plot.unit = "ms";
    plot.parts = {{"sort", 0}, {"fit", 1}};
    plot.bars = std::move(bars);
    return plot;
}

TEST(BarPlot, StacksItsParts) {
    const std::string html = bar_plot(bars_of({{.label = "one", .parts = {1, 3}}}));
    expect_sound(html);
    std::vector<double> x, width;
    const std::regex rect(
        "<rect class=\"fill c[01]\" x=\"([^\"]*)\" y=\"[^\"]*\" width=\"([^\"]*)\" height=\"15\"");
    for (std::sregex_iterator it(html.begin(), html.end(), rect), end; it != end; ++it) {
        x.push_back(std::stod((*it)[1]));
        width.push_back(std::stod((*it)[2]));
    }
    ASSERT_EQ(x.size(), 2u);
    EXPECT_NEAR(x[0] + width[0], x[1], 0.02);
    EXPECT_NEAR(width[1] / width[0], 3, 0.01);
    EXPECT_NE(html.find("4.00 ms"), std::string::npos);  // the sum behind the bar
    EXPECT_NE(html.find("sort: 1.00 ms, 25.0 %"), std::string::npos);
}

TEST(BarPlot, OddBars) {
    expect_sound(bar_plot(bars_of({})));
    expect_sound(
        bar_plot(bars_of({{.label = "none"},
                          {.label = "no_value", .parts = {no_value, no_end}},
                          {.label = "negative", .parts = {-5, 2}},
                          {.label = "zero", .parts = {0, 0}},
                          {.label = "huge", .parts = {1e12, 1}, .low = 1, .high = no_value},
                          {.label = "limit", .parts = {no_value}, .limit = 5, .mark = 9}})));
    const std::string html = bar_plot(bars_of({{.label = "none"}}));
    EXPECT_NE(html.find("no figure"), std::string::npos);
}

TEST(BarPlot, SimulatedBarsAreOutlines) {
    BarPlot plot = bars_of({{.label = "k", .parts = {4}}});
    plot.parts = {{"bound", 0}};
    plot.origin = Origin::simulated;
    const std::string html = bar_plot(plot);
    EXPECT_EQ(count(html, "class=\"outline"), 1u);
    EXPECT_EQ(count(html, "(simulated)"), 2u);
    EXPECT_EQ(count(html, "badge simulated"), 1u);
}

TEST(HistogramPlot, OneBarForEachFilledBin) {
    HistogramPlot plot;
    plot.label = "time, issues";
    plot.items = "warps";
    plot.rows = {{.label = "k", .edges = {0, 10, 20, 30}, .counts = {1, 0, 3}}};
    const std::string html = histogram_plot(plot);
    expect_sound(html);
    EXPECT_EQ(count(html, "class=\"fill"), 2u);
    EXPECT_NE(html.find("75.0 % of warps"), std::string::npos);
    EXPECT_NE(html.find("25.0 % of warps"), std::string::npos);
}

TEST(HistogramPlot, OddRows) {
    HistogramPlot plot;
    plot.rows = {{.label = "empty"},
                 {.label = "lengths", .edges = {0, 1}, .counts = {1, 2}},
                 {.label = "falling", .edges = {5, 3}, .counts = {1}},
                 {.label = "no_value", .edges = {0, no_value}, .counts = {1}},
                 {.label = "negative", .edges = {0, 1}, .counts = {-1}},
                 {.label = "zero", .edges = {0, 1}, .counts = {0}},
                 {.label = "point", .edges = {4, 4}, .counts = {3}},
                 {.label = "long", .edges = {0, 1e6}, .counts = {3}}};
    const std::string html = histogram_plot(plot);
    expect_sound(html);
    EXPECT_EQ(count(html, "no figure"), 6u);
    plot.rows.clear();
    EXPECT_NE(histogram_plot(plot).find("no figures to draw"), std::string::npos);
}

TEST(HistogramMedian, LiesInTheBinOfTheMiddle) {
    EXPECT_DOUBLE_EQ(histogram_median({.label = "", .edges = {0, 10, 20}, .counts = {1, 3}}),
                     10 + 10.0 / 3);
    EXPECT_DOUBLE_EQ(histogram_median({.label = "", .edges = {0, 10, 20}, .counts = {2, 2}}), 10);
    EXPECT_TRUE(std::isnan(histogram_median({.label = "", .edges = {0, 10}, .counts = {0}})));
    EXPECT_TRUE(std::isnan(histogram_median({})));
}

}  // namespace
}  // namespace raydix::report
