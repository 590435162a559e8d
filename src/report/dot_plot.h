// Rows with a mark for each series -> a plot of parts of a whole, 0 to 100 %: how full warps are,
// by operation and kernel.
#pragma once

#include <string>
#include <vector>

#include "report/figure.h"

namespace raydix::report {

struct DotSeries {
    std::string name;
    std::vector<double> parts;  // one for each row, 0..1; not finite: no mark
    int colour = 0, shape = 0;
};

struct DotPlot {
    std::string title = {}, note = {};
    std::string label = {};  // of the axis, with its unit
    Origin origin = Origin::none;
    std::vector<std::string> rows = {};
    std::vector<DotSeries> series = {};
};

/// Without a legend: several such plots share one.
[[nodiscard]] std::string dot_plot(const DotPlot& plot);
[[nodiscard]] std::vector<LegendItem> legend_of(const DotPlot& plot);

}  // namespace raydix::report
