// The ratio of one simulated figure to another, with its error: what the sample leaves open, and
// what the derivation of costs does (docs/costs.md).
#pragma once

#include <optional>
#include <string>

#include "simulation.h"

namespace raydix::cli {

struct Interval {
    double low, high;
};

/// `tightest`: of each row the lowest of its limits.
enum class Figure { bound, scheduled, tightest, instructions, slowest_warps };

struct RatioFound {
    std::optional<double> ratio;  // nothing if a figure is missing
    Interval error{};             // the ratio with all of its error
    std::string needs;            // what is missing for a ratio, or for its error or meaning
};

/// `a` over `b`. The error is the product of two ranges. The first comes from costs: each operation
/// of a machine takes any number of instructions between its cost and OperationCost::most. Kernels
/// share that number where their costs and ranges of the operation are equal, since it is the same
/// code there, and forms of one kernel that differ by persistence only share all; other kernels and
/// machines have numbers of their own. A schedule moves at most as its instructions do; so does a
/// memory limit, whose own clocks and rates are taken as they are. The second is two standard
/// errors of the sample, of the differences between units that both rows traced. The slowest 0.1 %
/// of warps also carry the width of their bins and, in a sample, two standard errors of their
/// number.
[[nodiscard]] RatioFound ratio_of(const SimulationRow& a, const SimulationRow& b, Figure figure);

}  // namespace raydix::cli
