#include "report/line_mask.h"

#include <algorithm>
#include <cmath>

namespace raydix {

namespace detail {

double distance_to_segment(double x, double y, const LineMask::End& a, const LineMask::End& b,
                           double& along) {
    const double dx = b.x - a.x, dy = b.y - a.y, squared = dx * dx + dy * dy;
    along = squared > 0 ? std::clamp(((x - a.x) * dx + (y - a.y) * dy) / squared, 0.0, 1.0) : 0.0;
    return std::hypot(x - (a.x + along * dx), y - (a.y + along * dy));
}

}  // namespace detail

void LineMask::clear() { std::fill(coverage_.begin(), coverage_.end(), 0.0f); }

bool LineMask::clip(End& a, End& b, double margin) const {
    double begin = 0, end = 1;
    const auto keep = [&](double from, double to, double low, double high) {
        if (from == to) {
            if (from < low || from > high) end = -1;
            return;
        }
        const double s = (low - from) / (to - from), t = (high - from) / (to - from);
        begin = std::max(begin, std::min(s, t));
        end = std::min(end, std::max(s, t));
    };
    keep(a.x, b.x, -margin, width_ + margin);
    keep(a.y, b.y, -margin, height_ + margin);
    if (!(begin <= end)) return false;
    const auto point = [&, from = a, to = b](double t) {
        return End{from.x + t * (to.x - from.x), from.y + t * (to.y - from.y),
                   from.inverse_depth + t * (to.inverse_depth - from.inverse_depth)};
    };
    const End first = point(begin), last = point(end);
    a = first;
    b = last;
    return true;
}

}  // namespace raydix
