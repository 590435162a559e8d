// A plot with what a reader needs beside it: title, where its figures are from, legend, note.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace raydix::report {

/// Where a figure is from. Whatever is not measured says so wherever it is shown.
enum class Origin { none, measured, simulated, modelled, published };

/// A small label, or nothing for Origin::none.
[[nodiscard]] std::string badge(Origin origin);
/// " (simulated)" and so on, for texts that cannot hold a label: axes, tooltips.
[[nodiscard]] std::string origin_suffix(Origin origin);

struct LegendItem {
    enum class Kind { line, markers, box, outline, limit, mark };
    std::string name;
    int colour = 0;
    Kind kind = Kind::box;
    int dash = 0, shape = 0;
};

struct Figure {
    std::string title = {};
    std::string subtitle = {};  // what scene, what settings
    Origin origin = Origin::none;
    std::vector<LegendItem> legend = {};
    std::string svg = {};
    std::string note = {};  // below the drawing
};

/// One legend for several figures, or for one.
[[nodiscard]] std::string legend_html(const std::vector<LegendItem>& legend);

/// `<figure>`; all texts are plain. The legend is text beside the drawing, so it cannot overlap it.
[[nodiscard]] std::string figure_html(const Figure& figure);

}  // namespace raydix::report
