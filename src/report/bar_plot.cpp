#include "report/bar_plot.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "report/html.h"
#include "report/number_text.h"
#include "report/plot_axis.h"
#include "report/svg.h"

namespace raydix::report {
namespace {

constexpr double width = 440, row_height = 41, bar_height = 15, top = 4;
// One slow repeat must not shrink all bars: spreads are cut off beyond this part of the longest
// bar.
constexpr double widest_spread = 1.3;

bool drawn(double v) { return std::isfinite(v) && v > 0; }

double sum_of(const Bar& bar) {
    double sum = 0;
    for (const double v : bar.parts)
        if (drawn(v)) sum += v;
    return sum;
}

bool has_values(const Bar& bar) {
    return std::ranges::any_of(bar.parts, [](double v) { return std::isfinite(v); }) ||
           std::isfinite(bar.limit) || std::isfinite(bar.mark);
}

/// Simulated bars are outlines, lightly filled; parts of a whole would not be told apart that way.
bool is_outlined(const BarPlot& plot) {
    return plot.origin == Origin::simulated && plot.parts.size() == 1;
}

double total_of(const Bar& bar) {
    if (std::isfinite(bar.total)) return bar.total;
    const bool any = std::ranges::any_of(bar.parts, [](double v) { return std::isfinite(v); });
    return any ? sum_of(bar) : Bar::none;
}

class Bars {
public:
    explicit Bars(const BarPlot& plot)
        : plot_(plot),
          bottom_(top +
                  row_height * static_cast<double>(std::max<std::size_t>(plot.bars.size(), 1))),
          svg_(width, bottom_ + 40, plot.title) {
        std::vector<double> all{0.0};
        double widest = 0, longest = 0;
        for (const Bar& bar : plot.bars) {
            for (const double v : {sum_of(bar), bar.limit, bar.mark}) all.push_back(v);
            widest = std::max(widest, text_width(value_text(bar), 12));
            longest = std::max(longest, sum_of(bar));
        }
        for (const Bar& bar : plot.bars)
            if (std::isfinite(bar.high))
                all.push_back(std::fmin(bar.high, widest_spread * longest));
        axis_ = linear_axis(all);
        right_ = std::max(width - 10 - widest, 200.0);
    }

    std::string draw() {
        for (const Tick& t : axis_.ticks) {
            svg_.line(x(t.value), top, x(t.value), bottom_, "grid");
            svg_.text(x(t.value), bottom_ + 16, t.label, "axis",
                      t.value == axis_.lo ? Anchor::start : Anchor::middle);
        }
        svg_.line(x(0), top, x(0), bottom_, "baseline");
        svg_.text(width, bottom_ + 34, plot_.label + origin_suffix(plot_.origin), "label",
                  Anchor::end);
        for (std::size_t i = 0; i < plot_.bars.size(); ++i)
            bar(plot_.bars[i], top + row_height * static_cast<double>(i));
        if (plot_.bars.empty()) svg_.text(left_, top + 24, "no figures to draw", "axis");
        return svg_.str();
    }

private:
    [[nodiscard]] double x(double v) const { return left_ + axis_.place(v) * (right_ - left_); }
    [[nodiscard]] std::string value_text(const Bar& bar) const {
        const double total = total_of(bar);
        std::string text = std::isfinite(total) ? significant(total) + " " + plot_.unit : "";
        if (!bar.note.empty()) text += (text.empty() ? "" : ", ") + bar.note;
        return text;
    }

    void bar(const Bar& bar, double y) {
        const double from = y + 19, middle = from + 0.5 * bar_height;
        svg_.text(left_, y + 14, shortened(bar.label, 64), "name");
        if (!has_values(bar)) return svg_.text(left_ + 4, middle + 4, "no figure", "axis");
        double end = x(0), sum = 0;
        for (std::size_t k = 0; k < bar.parts.size() && k < plot_.parts.size(); ++k) {
            if (!drawn(bar.parts[k])) continue;
            const double begin = x(sum);
            sum += bar.parts[k];
            svg_.open(bar.label + "\n" +
                      (plot_.parts[k].name.empty() ? "" : plot_.parts[k].name + ": ") +
                      significant(bar.parts[k]) + " " + plot_.unit + share_text(bar, k) +
                      origin_suffix(plot_.origin));
            svg_.rect(
                begin, from, std::max(x(sum) - begin, 0.8), bar_height,
                (is_outlined(plot_) ? "outline " : "fill ") + colour_class(plot_.parts[k].colour));
            svg_.close();
            end = std::max(x(sum), begin + 0.8);
        }
        end = std::max(end, extras(bar, from, middle));
        svg_.text(end + 6, middle + 4, value_text(bar), "value");
    }

    /// Outline, spread and mark. Returns how far right they reach.
    double extras(const Bar& bar, double from, double middle) {
        double end = x(0);
        if (drawn(bar.limit)) {
            svg_.open(bar.label + "\n" + plot_.limit_name + ": " + significant(bar.limit) + " " +
                      plot_.unit);
            svg_.rect(x(0), from - 2, x(bar.limit) - x(0), bar_height + 4, "limit");
            svg_.close();
            end = x(bar.limit);
        }
        if (drawn(bar.low) && drawn(bar.high) && bar.high > bar.low) {
            svg_.open(bar.label + "\n" + significant(bar.low) + " to " + significant(bar.high) +
                      " " + plot_.unit + " over the repeats");
            svg_.line(x(bar.low), middle, x(bar.high), middle, "whisker");
            svg_.line(x(bar.low), middle - 3, x(bar.low), middle + 3, "whisker");
            if (bar.high <= axis_.hi)
                svg_.line(x(bar.high), middle - 3, x(bar.high), middle + 3, "whisker");
            svg_.close();
            end = std::max(end, x(bar.high));
        }
        if (drawn(bar.mark)) {
            svg_.open(bar.label + "\n" + plot_.mark_name + ": " + significant(bar.mark) + " " +
                      plot_.unit + origin_suffix(plot_.origin));
            svg_.rect(x(bar.mark) - 5, from - 4, 10, bar_height + 8, "hit");
            // From the bar's upper edge: the label stands over it.
            svg_.line(x(bar.mark), from, x(bar.mark), from + bar_height + 4, "mark-line");
            svg_.close();
            end = std::max(end, x(bar.mark) + 2);
        }
        return end;
    }

    [[nodiscard]] std::string share_text(const Bar& bar, std::size_t part) const {
        return plot_.parts.size() > 1 ? ", " + percent(bar.parts[part] / sum_of(bar)) : "";
    }

    const BarPlot& plot_;
    double bottom_;
    Svg svg_;
    Axis axis_;
    double right_ = width - 80;
    static constexpr double left_ = 1;
};

}  // namespace

std::vector<LegendItem> legend_of(const BarPlot& plot) {
    std::vector<LegendItem> legend;
    if (plot.parts.size() > 1 || !plot.limit_name.empty() || !plot.mark_name.empty())
        for (const BarPart& part : plot.parts)
            legend.push_back(
                {part.name, part.colour,
                 is_outlined(plot) ? LegendItem::Kind::outline : LegendItem::Kind::box});
    if (!plot.limit_name.empty()) legend.push_back({plot.limit_name, 0, LegendItem::Kind::limit});
    if (!plot.mark_name.empty()) legend.push_back({plot.mark_name, 0, LegendItem::Kind::mark});
    return legend;
}

std::string bar_plot(const BarPlot& plot) {
    return figure_html({.title = plot.title,
                        .subtitle = plot.subtitle,
                        .origin = plot.origin,
                        .legend = plot.with_legend ? legend_of(plot) : std::vector<LegendItem>(),
                        .svg = Bars(plot).draw(),
                        .note = plot.note});
}

}  // namespace raydix::report
