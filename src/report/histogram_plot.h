// Histograms -> rows under each other on one axis: how long warps run, kernel by kernel.
#pragma once

#include <string>
#include <vector>

#include "report/figure.h"

namespace raydix::report {

/// counts [n], edges [n + 1] ascending. Anything else is shown as a row without a figure.
struct Histogram {
    std::string label;
    std::vector<double> edges = {}, counts = {};
    int colour = 0;
};

struct HistogramPlot {
    std::string title = {}, subtitle = {}, note = {};
    std::string label = {};  // of the axis, with its unit
    std::string items = {};  // what is counted: "warps"
    Origin origin = Origin::none;
    std::vector<Histogram> rows = {};  // each as high as its own fullest bin
};

[[nodiscard]] std::string histogram_plot(const HistogramPlot& plot);

[[nodiscard]] bool is_sound(const Histogram& histogram);

/// Where half of what was counted lies below, even within a bin; NaN if there is nothing.
[[nodiscard]] double histogram_median(const Histogram& histogram);

}  // namespace raydix::report
