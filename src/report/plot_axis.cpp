#include "report/plot_axis.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "report/number_text.h"

namespace raydix::report {
namespace {

constexpr int most_labels = 7;
// Up to this ratio of ends a log axis has evenly spaced values as ticks: it holds too few round
// ones.
constexpr double widest_even = 4;

std::vector<double> sorted_values(std::span<const double> values, bool positive) {
    std::vector<double> kept;
    for (const double v : values)
        if (std::isfinite(v) && (!positive || v > 0)) kept.push_back(v);
    std::ranges::sort(kept);
    return kept;
}

/// 1, 2 or 5 times a power of ten, so that about five steps cover `range`.
double round_step(double range) {
    const double raw = range / 5, power = std::pow(10.0, std::floor(std::log10(raw)));
    for (const double factor : {1.0, 2.0, 5.0})
        if (raw <= factor * power * 1.0001) return factor * power;
    return 10 * power;
}

/// Multiples of `mantissas` by powers of ten within [lo, hi].
std::vector<double> decade_ticks(double lo, double hi, std::span<const double> mantissas) {
    std::vector<double> ticks;
    const int first = static_cast<int>(std::floor(std::log10(lo))),
              last = static_cast<int>(std::ceil(std::log10(hi)));
    for (int e = first; e <= last; ++e)
        for (const double m : mantissas) {
            const double v = m * std::pow(10.0, e);
            if (v >= lo * 0.9999 && v <= hi * 1.0001) ticks.push_back(v);
        }
    return ticks;
}

/// Multiples of a round step within [lo, hi].
std::vector<double> even_ticks(double lo, double hi) {
    std::vector<double> ticks;
    const double step = round_step(hi - lo);
    for (double k = std::ceil(lo / step - 1e-9); k * step <= hi * (1 + 1e-9); ++k)
        ticks.push_back(k * step);
    return ticks;
}

}  // namespace

bool Axis::shows(double value) const { return std::isfinite(value) && (!log || value > 0); }

double Axis::place(double value) const {
    // Not log(value / lo): the ratio of numbers that a document may hold can overflow.
    const double part = log ? (std::log(value) - std::log(lo)) / (std::log(hi) - std::log(lo))
                            : (value - lo) / (hi - lo);
    return std::clamp(part, 0.0, 1.0);
}

Axis linear_axis(std::span<const double> values, bool from_zero) {
    const std::vector<double> kept = sorted_values(values, false);
    Axis axis;
    axis.lo = kept.empty() ? 0 : kept.front();
    axis.hi = kept.empty() ? 1 : kept.back();
    if (from_zero) {
        axis.lo = std::min(axis.lo, 0.0);
        axis.hi = std::max(axis.hi, 0.0);
    }
    const double size = std::max(std::fabs(axis.lo), std::fabs(axis.hi));
    if (!(axis.hi - axis.lo > 1e-9 * size)) {  // one value: room on both sides of it
        const double room = size > 0 ? 0.5 * size : 1;
        axis.lo = from_zero && axis.lo >= 0 ? 0 : axis.lo - room;
        axis.hi += room;
    }
    const double step = round_step(axis.hi - axis.lo);
    const double first = std::floor(axis.lo / step + 1e-9), last = std::ceil(axis.hi / step - 1e-9);
    axis.lo = first * step;
    axis.hi = last * step;
    for (double k = first; k <= last; ++k) axis.ticks.push_back({k * step, short_number(k * step)});
    return axis;
}

Axis log_axis(std::span<const double> values) {
    const std::vector<double> kept = sorted_values(values, true);
    Axis axis{.log = true, .lo = 1, .hi = 10, .ticks = {}};
    if (!kept.empty()) {
        axis.lo = kept.front() * 0.9;
        axis.hi = kept.back() * 1.1;
    }
    static constexpr std::array<double, 9> all{1, 2, 3, 4, 5, 6, 7, 8, 9};
    static constexpr std::array<double, 3> few{1, 2, 5};
    static constexpr std::array<double, 1> one{1};
    std::vector<double> labelled = even_ticks(axis.lo, axis.hi);
    const bool narrow = axis.hi / axis.lo < widest_even;
    for (const std::span<const double> set :
         {std::span<const double>(all), std::span<const double>(few),
          std::span<const double>(one)}) {
        if (narrow) break;
        labelled = decade_ticks(axis.lo, axis.hi, set);
        if (labelled.size() <= most_labels) break;
    }
    // Twelve decades have too many powers of ten, too.
    const std::size_t stride = labelled.size() / (most_labels + 1) + 1;
    for (std::size_t i = 0; i < labelled.size(); i += stride)
        axis.ticks.push_back({labelled[i], short_number(labelled[i])});
    return axis;
}

Axis log_axis_at(std::span<const double> values) {
    std::vector<double> kept = sorted_values(values, true);
    kept.erase(std::unique(kept.begin(), kept.end()), kept.end());
    if (kept.empty()) return log_axis({});
    Axis axis{.log = true, .lo = kept.front() / 1.08, .hi = kept.back() * 1.08, .ticks = {}};
    const std::size_t stride = kept.size() / 10 + 1;
    for (std::size_t i = 0; i < kept.size(); ++i)
        axis.ticks.push_back({kept[i], i % stride ? "" : short_number(kept[i])});
    return axis;
}

}  // namespace raydix::report
