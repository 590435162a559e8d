#include "report/dot_plot.h"

#include <algorithm>
#include <cmath>

#include "report/html.h"
#include "report/number_text.h"
#include "report/svg.h"

namespace raydix::report {
namespace {

constexpr double width = 440, top = 6, row_height = 30, right = width - 14;

class Dots {
public:
    explicit Dots(const DotPlot& plot)
        : plot_(plot),
          bottom_(top +
                  row_height * static_cast<double>(std::max<std::size_t>(plot.rows.size(), 1))),
          svg_(width, bottom_ + 42, plot.title) {
        for (const std::string& row : plot.rows)
            left_ = std::max(left_, std::min(text_width(shortened(row, longest_name)) + 12, 190.0));
    }

    std::string draw() {
        for (int part = 0; part <= 100; part += 20) {
            svg_.line(x(part / 100.0), top, x(part / 100.0), bottom_, "grid");
            svg_.text(x(part / 100.0), bottom_ + 17, std::to_string(part), "axis", Anchor::middle);
        }
        svg_.text(right, bottom_ + 35, plot_.label + origin_suffix(plot_.origin), "label",
                  Anchor::end);
        for (std::size_t row = 0; row < plot_.rows.size(); ++row) {
            const double y = top + row_height * (static_cast<double>(row) + 0.5);
            svg_.text(left_ - 10, y + 4, shortened(plot_.rows[row], longest_name), "name",
                      Anchor::end);
            svg_.line(left_, y, right, y, "grid");
            marks(row, y);
        }
        if (plot_.rows.empty()) svg_.text(left_, top + 20, "no figures to draw", "axis");
        return svg_.str();
    }

private:
    [[nodiscard]] double x(double part) const {
        return left_ + std::clamp(part, 0.0, 1.0) * (right - left_);
    }

    void marks(std::size_t row, double y) {
        for (std::size_t k = 0; k < plot_.series.size(); ++k) {
            const DotSeries& s = plot_.series[k];
            if (row >= s.parts.size() || !std::isfinite(s.parts[row])) continue;
            // Equal values would hide each other: each series has a height of its own in the row.
            const double spread =
                plot_.series.size() > 1
                    ? (static_cast<double>(k) / static_cast<double>(plot_.series.size() - 1) -
                       0.5) *
                          16
                    : 0;
            svg_.open(s.name + "\n" + plot_.rows[row] + ": " + percent(s.parts[row]) +
                      origin_suffix(plot_.origin));
            svg_.rect(x(s.parts[row]) - 6, y + spread - 4, 12, 8, "hit");
            svg_.marker(s.shape, x(s.parts[row]), y + spread, colour_class(s.colour));
            svg_.close();
        }
    }

    static constexpr std::size_t longest_name = 28;
    const DotPlot& plot_;
    double bottom_;
    Svg svg_;
    double left_ = 60;
};

}  // namespace

std::vector<LegendItem> legend_of(const DotPlot& plot) {
    std::vector<LegendItem> legend;
    for (const DotSeries& s : plot.series)
        legend.push_back({s.name, s.colour, LegendItem::Kind::markers, 0, s.shape});
    return legend;
}

std::string dot_plot(const DotPlot& plot) {
    return figure_html(
        {.title = plot.title, .origin = plot.origin, .svg = Dots(plot).draw(), .note = plot.note});
}

}  // namespace raydix::report
