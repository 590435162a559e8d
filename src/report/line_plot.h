// Series of points -> a plot with axes, grid, markers, and a tooltip on each point.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "report/figure.h"

namespace raydix::report {

struct Series {
    std::string name = {};
    std::vector<double> x = {}, y = {};  // the same length; what an axis cannot show leaves a gap
    int colour = 0, dash = 0, shape = 0;
    bool markers_only = false;
};

struct LinePlot {
    enum class Scale { linear, log, log_at_points };
    std::string title = {}, subtitle = {}, note = {};
    std::string x_label = {}, y_label = {};  // with units
    std::string x_unit = {}, y_unit = {};    // for tooltips
    Scale x_scale = Scale::linear, y_scale = Scale::linear;
    Origin origin = Origin::none;
    std::vector<Series> series = {};
    bool with_legend = true;  // false: it stands elsewhere, see legend_of
    /// A thin line from corner to corner of equal x and y: the ideal speed-up. Log axes only.
    bool diagonal = false;
    /// A thin horizontal line here, if finite.
    double reference = std::numeric_limits<double>::quiet_NaN();
};

[[nodiscard]] std::vector<LegendItem> legend_of(const LinePlot& plot);
[[nodiscard]] std::string line_plot(const LinePlot& plot);

}  // namespace raydix::report
