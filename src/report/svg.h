// A drawing as SVG text. Colours are classes (c0 to c7, and those of page_style.cpp), so that
// light, dark and print have their own; texts are plain and escaped here.
#pragma once

#include <string>
#include <string_view>

namespace raydix::report {

inline constexpr int palette_size = 8;

/// "c3": a series' colour; more series than colours begin again.
[[nodiscard]] std::string colour_class(int series);
/// Stroke pattern and marker of a series, so that colour is never the only difference.
[[nodiscard]] std::string dash_class(int dash);

enum class Anchor { start, middle, end };

class Svg {
public:
    /// `label` is what a screen reader says.
    Svg(double width, double height, std::string_view label);

    void line(double x1, double y1, double x2, double y2, std::string_view style);
    void rect(double x, double y, double width, double height, std::string_view style);
    void text(double x, double y, std::string_view text, std::string_view style,
              Anchor anchor = Anchor::start);
    /// `path`: an SVG path made of numbers.
    void path(std::string_view path, std::string_view style);
    /// One of eight shapes around a point.
    void marker(int shape, double x, double y, std::string_view style);
    /// All that follows shows `tip` under the pointer, until close().
    void open(std::string_view tip, std::string_view style = "");
    void close() { body_ += "</g>"; }

    [[nodiscard]] std::string str() const { return body_ + "</svg>"; }

private:
    std::string body_;
};

/// About as wide as `text` is drawn with `font_size`.
[[nodiscard]] double text_width(std::string_view text, double font_size = 12);

/// "12.5": two digits behind the point at most.
[[nodiscard]] std::string coordinate(double v);

}  // namespace raydix::report
