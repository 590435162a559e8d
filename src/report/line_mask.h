// Smooth lines and dots on a raster of coverage: segments in pixels -> mask [height * width], 0..1.
// Where strokes meet the greater coverage stands, so that their order does not matter.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace raydix {

class LineMask {
public:
    LineMask(std::uint32_t width, std::uint32_t height)
        : width_(width), height_(height), coverage_(std::size_t{width} * height) {}

    /// An end of a segment: pixels from the upper left corner, and the inverse of its distance.
    struct End {
        double x, y, inverse_depth;
    };
    /// `shade(pixel, inverse_depth)` -> 0..1 weakens the stroke in a pixel. Whatever lies outside
    /// of the raster costs nothing.
    template <class Shade>
    void add_line(End a, End b, double line_width, const Shade& shade);

    void clear();
    [[nodiscard]] const std::vector<float>& coverage() const { return coverage_; }

private:
    /// Cuts the segment down to the raster and a margin; false if nothing is left.
    [[nodiscard]] bool clip(End& a, End& b, double margin) const;
    void cover(std::size_t pixel, double part) {
        const auto value = static_cast<float>(part);
        if (value > coverage_[pixel]) coverage_[pixel] = value;
    }

    std::uint32_t width_, height_;
    std::vector<float> coverage_;
};

namespace detail {
/// Distance of (x, y) from the segment that starts at (ax, ay), runs along (dx, dy) and has this
/// squared length; `along` becomes the place of the nearest point, 0..1.
double distance_to_segment(double x, double y, const LineMask::End& a, const LineMask::End& b,
                           double& along);
}  // namespace detail

template <class Shade>
void LineMask::add_line(End a, End b, double line_width, const Shade& shade) {
    const double reach = 0.5 * line_width + 0.5;  // half the line, and half a pixel of soft edge
    if (!clip(a, b, reach + 1)) return;
    // Runs along the axis on which the segment is longer, a few pixels across each step.
    const double dx = b.x - a.x, dy = b.y - a.y;
    const bool steep = dy * dy > dx * dx;
    const double from = steep ? a.y : a.x, to = steep ? b.y : b.x;
    const double other = steep ? a.x : a.y, slope = from == to ? 0 : (steep ? dx / dy : dy / dx);
    const double across = reach * 1.5;  // a slanting line is wider along the other axis, up to 1.42
    const auto limit = static_cast<double>(steep ? height_ : width_) - 1;
    const auto other_limit = static_cast<double>(steep ? width_ : height_) - 1;
    const auto bounded = [](double v, double most) { return v < 0 ? 0.0 : v > most ? most : v; };
    const auto low = static_cast<std::int64_t>(bounded((from < to ? from : to) - reach, limit));
    const auto high = static_cast<std::int64_t>(bounded((from < to ? to : from) + reach, limit));
    for (std::int64_t i = low; i <= high; ++i) {
        const double middle = other + slope * (static_cast<double>(i) + 0.5 - from);
        const auto first = static_cast<std::int64_t>(bounded(middle - across, other_limit));
        const auto last = static_cast<std::int64_t>(bounded(middle + across, other_limit));
        for (std::int64_t k = first; k <= last; ++k) {
            const std::int64_t x = steep ? k : i, y = steep ? i : k;
            double along;
            const double distance = detail::distance_to_segment(
                static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5, a, b, along);
            if (distance >= reach) continue;
            const auto pixel = static_cast<std::size_t>(y) * width_ + static_cast<std::size_t>(x);
            const double part = reach - distance < 1 ? reach - distance : 1;
            const double depth = a.inverse_depth + along * (b.inverse_depth - a.inverse_depth);
            cover(pixel, part * shade(pixel, depth));
        }
    }
}

}  // namespace raydix
