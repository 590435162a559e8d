#include "report/histogram_plot.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "report/html.h"
#include "report/number_text.h"
#include "report/plot_axis.h"
#include "report/svg.h"

namespace raydix::report {
namespace {

constexpr double width = 440, top = 26, row_height = 64, bar_space = 38, left = 46,
                 right = width - 10;
// Rows whose ends lie further apart than this share a log axis, or the shorter ones are a speck.
constexpr double widest_linear_range = 30;

double sum_of(const Histogram& h) { return std::accumulate(h.counts.begin(), h.counts.end(), 0.0); }

Axis axis_of(const std::vector<Histogram>& rows) {
    std::vector<double> ends, positive;
    for (const Histogram& h : rows) {
        if (!is_sound(h)) continue;
        ends.push_back(h.edges.back());
        for (std::size_t i = 0; i < h.counts.size(); ++i)
            if (h.counts[i] > 0)
                for (const double edge : {h.edges[i], h.edges[i + 1]})
                    if (edge > 0) positive.push_back(edge);
    }
    if (ends.empty() || positive.empty()) return linear_axis(ends);
    const auto [least, most] = std::ranges::minmax(ends);
    return most > widest_linear_range * least ? log_axis(positive) : linear_axis(ends);
}

class Rows {
public:
    explicit Rows(const HistogramPlot& plot)
        : plot_(plot),
          axis_(axis_of(plot.rows)),
          bottom_(top +
                  row_height * static_cast<double>(std::max<std::size_t>(plot.rows.size(), 1))),
          svg_(width, bottom_ + 42, plot.title) {}

    std::string draw() {
        svg_.text(0, 13, "share of " + plot_.items + ", %" + origin_suffix(plot_.origin), "label");
        double free_from = 0;
        for (const Tick& t : axis_.ticks) {
            svg_.line(x(t.value), top, x(t.value), bottom_, "grid");
            const double half = 0.5 * text_width(t.label, 12);
            if (t.label.empty() || x(t.value) - half < free_from) continue;
            svg_.text(x(t.value), bottom_ + 17, t.label, "axis", Anchor::middle);
            free_from = x(t.value) + half + 6;
        }
        svg_.text(right, bottom_ + 35, plot_.label + (axis_.log ? ", log scale" : ""), "label",
                  Anchor::end);
        for (std::size_t i = 0; i < plot_.rows.size(); ++i)
            row(plot_.rows[i], top + row_height * static_cast<double>(i));
        if (plot_.rows.empty()) svg_.text(left, top + 30, "no figures to draw", "axis");
        return svg_.str();
    }

private:
    /// The first bin may begin at 0, which a log axis does not have: its lower end stands in.
    [[nodiscard]] double x(double v) const {
        return left + (axis_.shows(v) ? axis_.place(v) : 0) * (right - left);
    }

    void row(const Histogram& h, double y) {
        const double base = y + row_height - 4;
        svg_.text(left, y + 14, shortened(h.label, 56), "name");
        svg_.line(left, base, right, base, "baseline");
        const double sum = is_sound(h) ? sum_of(h) : 0;
        if (sum <= 0) return svg_.text(left + 4, base - 10, "no figure", "axis");
        const double most = *std::ranges::max_element(h.counts);
        svg_.text(left - 6, base - bar_space + 8, significant(100 * most / sum, 2), "axis",
                  Anchor::end);
        svg_.text(left - 6, base + 1, "0", "axis", Anchor::end);
        for (std::size_t i = 0; i < h.counts.size(); ++i) {
            if (h.counts[i] <= 0) continue;
            const double from = x(h.edges[i]), to = x(h.edges[i + 1]);
            const double height = std::max(bar_space * h.counts[i] / most, 0.8);
            svg_.open(h.label + "\n" + significant(h.edges[i]) + " to " +
                      significant(h.edges[i + 1]) + ": " + percent(h.counts[i] / sum) + " of " +
                      plot_.items + origin_suffix(plot_.origin));
            svg_.rect(from, base - bar_space, std::max(to - from, 1.0), bar_space, "hit");
            svg_.rect(from, base - height, std::max(to - from - 0.6, 0.8), height,
                      "fill " + colour_class(h.colour));
            svg_.close();
        }
        median(h, base);
    }

    void median(const Histogram& h, double base) {
        const double at = histogram_median(h);
        if (!axis_.shows(at)) return;
        svg_.open(h.label + "\nhalf of the " + plot_.items + " lie below " + significant(at) +
                  origin_suffix(plot_.origin));
        svg_.rect(x(at) - 4, base - bar_space, 8, bar_space, "hit");
        svg_.line(x(at), base - bar_space - 2, x(at), base, "mark-line");
        svg_.close();
    }

    const HistogramPlot& plot_;
    Axis axis_;
    double bottom_;
    Svg svg_;
};

}  // namespace

bool is_sound(const Histogram& h) {
    const auto fine = [](double v) { return std::isfinite(v) && v >= 0; };
    return !h.counts.empty() && h.edges.size() == h.counts.size() + 1 &&
           std::ranges::all_of(h.edges, fine) && std::ranges::all_of(h.counts, fine) &&
           std::ranges::is_sorted(h.edges);
}

double histogram_median(const Histogram& h) {
    if (!is_sound(h)) return std::numeric_limits<double>::quiet_NaN();
    double left_over = 0.5 * sum_of(h);
    for (std::size_t i = 0; i < h.counts.size(); ++i) {
        if (h.counts[i] > 0 && left_over <= h.counts[i])
            return h.edges[i] + left_over / h.counts[i] * (h.edges[i + 1] - h.edges[i]);
        left_over -= h.counts[i];
    }
    return std::numeric_limits<double>::quiet_NaN();
}

std::string histogram_plot(const HistogramPlot& plot) {
    return figure_html({.title = plot.title,
                        .subtitle = plot.subtitle,
                        .origin = plot.origin,
                        .svg = Rows(plot).draw(),
                        .note = plot.note});
}

}  // namespace raydix::report
