#include "report/line_plot.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "report/number_text.h"
#include "report/plot_axis.h"
#include "report/svg.h"

namespace raydix::report {
namespace {

constexpr double width = 440, height = 290;
constexpr std::size_t most_markers = 16;

Axis axis_of(LinePlot::Scale scale, const std::vector<double>& values) {
    switch (scale) {
        case LinePlot::Scale::log:
            return log_axis(values);
        case LinePlot::Scale::log_at_points:
            return log_axis_at(values);
        case LinePlot::Scale::linear:
            break;
    }
    return linear_axis(values);
}

class Drawing {
public:
    explicit Drawing(const LinePlot& plot) : plot_(plot), svg_(width, height, plot.title) {
        std::vector<double> xs, ys;
        for (const Series& s : plot.series)
            for (std::size_t i = 0; i < points_of(s); ++i)
                if (std::isfinite(s.x[i]) && std::isfinite(s.y[i])) {
                    xs.push_back(s.x[i]);
                    ys.push_back(s.y[i]);
                }
        empty_ = xs.empty();
        if (std::isfinite(plot.reference)) ys.push_back(plot.reference);
        x_ = axis_of(plot.x_scale, xs);
        y_ = axis_of(plot.y_scale, ys);
        double widest = 0;
        for (const Tick& t : y_.ticks) widest = std::max(widest, text_width(t.label, 12));
        left_ = 14 + widest;
    }

    std::string draw() {
        axes();
        if (empty_)
            svg_.text(0.5 * (left_ + right_), 140, "no figures to draw", "axis", Anchor::middle);
        if (plot_.diagonal) diagonal();
        for (const Series& s : plot_.series)
            if (!s.markers_only) stroke(s);
        for (const Series& s : plot_.series) markers(s);
        return svg_.str();
    }

private:
    static std::size_t points_of(const Series& s) { return std::min(s.x.size(), s.y.size()); }
    [[nodiscard]] double px(double x) const { return left_ + x_.place(x) * (right_ - left_); }
    [[nodiscard]] double py(double y) const { return bottom_ - y_.place(y) * (bottom_ - top_); }

    void axes() {
        for (const Tick& t : y_.ticks) {
            svg_.line(left_, py(t.value), right_, py(t.value), "grid");
            svg_.text(left_ - 7, py(t.value) + 4, t.label, "axis", Anchor::end);
        }
        double free_from = 0;  // labels that would touch the one before are left out
        for (const Tick& t : x_.ticks) {
            const double x = px(t.value), half = 0.5 * text_width(t.label, 12);
            svg_.line(x, top_, x, bottom_, "grid");
            if (t.label.empty() || x - half < free_from) continue;
            svg_.text(x, bottom_ + 17, t.label, "axis", Anchor::middle);
            free_from = x + half + 6;
        }
        svg_.line(left_, bottom_, right_, bottom_, "baseline");
        svg_.text(0, 13, plot_.y_label + origin_suffix(plot_.origin), "label");
        svg_.text(right_, bottom_ + 35, plot_.x_label, "label", Anchor::end);
        if (y_.shows(plot_.reference))
            svg_.line(left_, py(plot_.reference), right_, py(plot_.reference), "reference");
    }

    /// Where x and y are equal, within both axes.
    void diagonal() {
        const double from = std::max(x_.lo, y_.lo), to = std::min(x_.hi, y_.hi);
        if (from < to) svg_.line(px(from), py(from), px(to), py(to), "reference");
    }

    [[nodiscard]] bool shows(const Series& s, std::size_t i) const {
        return x_.shows(s.x[i]) && y_.shows(s.y[i]);
    }

    void stroke(const Series& s) {
        std::string path;
        bool pen_up = true;
        for (std::size_t i = 0; i < points_of(s); ++i) {
            if (!shows(s, i)) {
                pen_up = true;
                continue;
            }
            path += pen_up ? 'M' : 'L';
            path += coordinate(px(s.x[i])) + " " + coordinate(py(s.y[i]));
            pen_up = false;
        }
        if (!path.empty())
            svg_.path(path, "stroke " + colour_class(s.colour) + " " + dash_class(s.dash));
    }

    void markers(const Series& s) {
        const std::size_t every = points_of(s) / most_markers + 1;  // more would hide the line
        for (std::size_t i = 0; i < points_of(s); ++i) {
            if (!shows(s, i)) continue;
            const auto with_unit = [](double v, const std::string& unit) {
                return unit.empty() ? significant(v) : significant(v) + " " + unit;
            };
            svg_.open(s.name + "\n" + with_unit(s.x[i], plot_.x_unit) + ": " +
                      with_unit(s.y[i], plot_.y_unit) + origin_suffix(plot_.origin));
            svg_.rect(px(s.x[i]) - 8, py(s.y[i]) - 8, 16, 16, "hit");
            if (i % every == 0)
                svg_.marker(s.shape, px(s.x[i]), py(s.y[i]), colour_class(s.colour));
            svg_.close();
        }
    }

    const LinePlot& plot_;
    Svg svg_;
    Axis x_, y_;
    bool empty_ = false;
    double left_ = 40;
    static constexpr double right_ = width - 12, top_ = 30, bottom_ = height - 42;
};

}  // namespace

std::vector<LegendItem> legend_of(const LinePlot& plot) {
    std::vector<LegendItem> legend;
    for (const Series& s : plot.series)
        legend.push_back({s.name, s.colour,
                          s.markers_only ? LegendItem::Kind::markers : LegendItem::Kind::line,
                          s.dash, s.shape});
    return legend;
}

std::string line_plot(const LinePlot& plot) {
    return figure_html({.title = plot.title,
                        .subtitle = plot.subtitle,
                        .origin = plot.origin,
                        .legend = plot.with_legend ? legend_of(plot) : std::vector<LegendItem>(),
                        .svg = Drawing(plot).draw(),
                        .note = plot.note});
}

}  // namespace raydix::report
