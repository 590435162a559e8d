#include "report/svg.h"

#include <fmt/format.h>

#include <cmath>

#include "report/html.h"

namespace raydix::report {

std::string colour_class(int series) { return fmt::format("c{}", series % palette_size); }
std::string dash_class(int dash) { return fmt::format("d{}", dash % 4); }

std::string coordinate(double v) {
    if (!std::isfinite(v)) return "0";
    std::string digits = fmt::format("{:.2f}", v);
    digits.erase(digits.find_last_not_of('0') + 1);
    if (digits.back() == '.') digits.pop_back();
    return digits == "-0" ? "0" : digits;
}

double text_width(std::string_view text, double font_size) {
    std::size_t characters = 0;
    for (const char c : text) characters += (static_cast<unsigned char>(c) & 0xC0u) != 0x80u;
    return 0.56 * font_size * static_cast<double>(characters);
}

Svg::Svg(double width, double height, std::string_view label)
    : body_(fmt::format("<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">",
                        coordinate(width), coordinate(height), escaped(label))) {}

void Svg::line(double x1, double y1, double x2, double y2, std::string_view style) {
    body_ +=
        fmt::format("<line class=\"{}\" x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\"/>", escaped(style),
                    coordinate(x1), coordinate(y1), coordinate(x2), coordinate(y2));
}

void Svg::rect(double x, double y, double width, double height, std::string_view style) {
    body_ += fmt::format("<rect class=\"{}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/>",
                         escaped(style), coordinate(x), coordinate(y),
                         coordinate(std::fmax(width, 0)), coordinate(std::fmax(height, 0)));
}

void Svg::text(double x, double y, std::string_view text, std::string_view style, Anchor anchor) {
    constexpr const char* anchors[] = {"start", "middle", "end"};
    body_ += fmt::format("<text class=\"{}\" x=\"{}\" y=\"{}\" text-anchor=\"{}\">{}</text>",
                         escaped(style), coordinate(x), coordinate(y),
                         anchors[static_cast<int>(anchor)], escaped(text));
}

void Svg::path(std::string_view path, std::string_view style) {
    body_ += fmt::format("<path class=\"{}\" d=\"{}\"/>", escaped(style), escaped(path));
}

void Svg::marker(int shape, double x, double y, std::string_view style) {
    const auto at = [&](double dx, double dy) {
        return coordinate(x + dx) + " " + coordinate(y + dy);
    };
    const std::string mark = fmt::format("mark {}", style);
    switch (shape % 8) {
        case 0:
            body_ += fmt::format("<circle class=\"{}\" cx=\"{}\" cy=\"{}\" r=\"3.4\"/>",
                                 escaped(mark), coordinate(x), coordinate(y));
            return;
        case 1:  // square
            return rect(x - 3.1, y - 3.1, 6.2, 6.2, mark);
        case 2:  // triangle up
            return path(fmt::format("M{}L{}L{}Z", at(0, -4), at(4, 3.2), at(-4, 3.2)), mark);
        case 3:  // diamond
            return path(
                fmt::format("M{}L{}L{}L{}Z", at(0, -4.4), at(4.4, 0), at(0, 4.4), at(-4.4, 0)),
                mark);
        case 4:  // triangle down
            return path(fmt::format("M{}L{}L{}Z", at(0, 4), at(4, -3.2), at(-4, -3.2)), mark);
        case 5:  // cross
            return path(fmt::format("M{}L{}M{}L{}", at(-3.4, -3.4), at(3.4, 3.4), at(-3.4, 3.4),
                                    at(3.4, -3.4)),
                        mark + " open");
        case 6:  // plus
            return path(
                fmt::format("M{}L{}M{}L{}", at(-4.2, 0), at(4.2, 0), at(0, -4.2), at(0, 4.2)),
                mark + " open");
        default:  // ring
            body_ += fmt::format("<circle class=\"{} ring\" cx=\"{}\" cy=\"{}\" r=\"3.4\"/>",
                                 escaped(mark), coordinate(x), coordinate(y));
    }
}

void Svg::open(std::string_view tip, std::string_view style) {
    body_ += style.empty() ? "<g>" : fmt::format("<g class=\"{}\">", escaped(style));
    if (!tip.empty()) body_ += fmt::format("<title>{}</title>", escaped(tip));
}

}  // namespace raydix::report
