// Values -> an axis: its range, its ticks, and where a value lies on it.
#pragma once

#include <span>
#include <string>
#include <vector>

namespace raydix::report {

struct Tick {
    double value = 0;
    std::string label;  // empty: a grid line only
};

struct Axis {
    bool log = false;
    double lo = 0, hi = 1;
    std::vector<Tick> ticks;

    /// Finite, and above 0 on a log axis.
    [[nodiscard]] bool shows(double value) const;
    /// 0 at lo, 1 at hi, held within. Only for values that it shows.
    [[nodiscard]] double place(double value) const;
};

/// From 0 (or from the smallest value if `from_zero` is false or values are negative) to a round
/// value past the largest. Values that are not finite do not count; without any: 0 to 1.
[[nodiscard]] Axis linear_axis(std::span<const double> values, bool from_zero = true);

/// From a round value below the smallest positive one to one past the largest. Ticks at powers of
/// ten, with 2 and 5 between where there is room. Values that are not positive do not count;
/// without any: 1 to 10.
[[nodiscard]] Axis log_axis(std::span<const double> values);

/// A log axis with a tick at each of the values: sizes of machines, warp widths.
[[nodiscard]] Axis log_axis_at(std::span<const double> values);

}  // namespace raydix::report
