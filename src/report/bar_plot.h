// Values with names -> horizontal bars, one or several parts each. Names stand above their bars, so
// that long ones fit on a phone.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "report/figure.h"

namespace raydix::report {

struct BarPart {
    std::string name;
    int colour = 0;
};

struct Bar {
    static constexpr double none = std::numeric_limits<double>::quiet_NaN();
    std::string label = {};
    std::vector<double> parts = {};  // one for each BarPart; not finite or negative: not drawn
    double total = none;             // written behind the bar; none: the sum of the parts
    double low = none, high = none;  // a thin line over the bar: the spread of repeats
    double limit = none;             // an outline around the bar: what bounds it from above
    double mark = none;              // a stroke across the bar: a published figure
    std::string note = {};           // behind the value
};

struct BarPlot {
    std::string title = {}, subtitle = {}, note = {};
    std::string label = {};  // of the axis, with its unit
    std::string unit = {};   // of the values behind the bars
    Origin origin = Origin::none;
    std::vector<BarPart> parts = {};  // a legend if there are several
    bool with_legend = true;          // false: it stands elsewhere, see legend_of
    std::string limit_name = {}, mark_name = {};
    std::vector<Bar> bars = {};
};

[[nodiscard]] std::vector<LegendItem> legend_of(const BarPlot& plot);
[[nodiscard]] std::string bar_plot(const BarPlot& plot);

}  // namespace raydix::report
