#include "ratio_error.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

namespace raydix::cli {
namespace {

/// What an operation takes, in the order of the simulation's operations.
struct OperationRange {
    double issues;              // per ray
    double instructions, most;  // of one issue: as charged, and as its derivation allows
    [[nodiscard]] double beyond() const { return issues * (most - instructions); }
};

struct IssueRange {
    double charged = 0;  // instructions per ray
    std::vector<OperationRange> operations;
};

IssueRange issue_range(const SimulationRow& row) {
    IssueRange range;
    const std::string_view kernel = warp_kernel_name(row.options.kernel);
    const auto rays = static_cast<double>(row.sum.rays);
    for (const OperationFigure& op : row.sum.operations) {
        OperationRange here{.issues = static_cast<double>(op.issues) / rays,
                            .instructions = static_cast<double>(op.instructions),
                            .most = static_cast<double>(op.instructions)};
        for (const OperationCost& cost : row.options.machine.costs)
            if (cost.operation == op.operation && (cost.kernel.empty() || cost.kernel == kernel) &&
                cost.most > op.instructions)
                here.most = cost.most;
        range.charged += here.issues * here.instructions;
        range.operations.push_back(here);
    }
    return range;
}

/// The largest a / b. An operation that is `shared` is at the same end of its range in both: at the
/// end that raises the ratio found so far, until none does.
double largest_ratio(const IssueRange& a, const IssueRange& b, const std::vector<bool>& shared) {
    double most = a.charged;
    for (std::size_t k = 0; k < shared.size(); ++k)
        if (!shared[k]) most += a.operations[k].beyond();
    double ratio = most / b.charged;
    while (true) {
        double above = most, below = b.charged;
        for (std::size_t k = 0; k < shared.size(); ++k) {
            const double x = a.operations[k].beyond(), y = b.operations[k].beyond();
            if (shared[k] && x > ratio * y) above += x, below += y;
        }
        if (above / below <= ratio * (1 + 1e-12)) return ratio;
        ratio = above / below;
    }
}

/// Whether one is the persistent form of the other.
bool same_steps(const SimulationRow& a, const SimulationRow& b) {
    constexpr std::string_view prefix = "persistent_";
    const auto body = [&](const SimulationRow& row) {
        std::string_view name = warp_kernel_name(row.options.kernel);
        if (name.starts_with(prefix)) name.remove_prefix(prefix.size());
        return name;
    };
    return body(a) == body(b);
}

/// Instructions of `a` over those of `b`, both per ray, relative to what is charged.
Interval cost_range(const SimulationRow& a, const SimulationRow& b) {
    const IssueRange x = issue_range(a), y = issue_range(b);
    std::vector<bool> shared;
    for (std::size_t k = 0; k < x.operations.size(); ++k) {
        const OperationRange &p = x.operations[k], &q = y.operations[k];
        shared.push_back(
            a.options.machine.name == b.options.machine.name &&
            (same_steps(a, b) || (p.instructions == q.instructions && p.most == q.most)));
    }
    const double charged = x.charged / y.charged;
    return {1.0 / (largest_ratio(y, x, shared) * charged), largest_ratio(x, y, shared) / charged};
}

/// Relative standard error of the ratio of two rates whose rows traced the same units.
std::optional<double> paired_error(const SimulationRow& a, double SimulatedRates::*rate_a,
                                   const SimulationRow& b, double SimulatedRates::*rate_b) {
    if (a.part_taken >= 1.0 && b.part_taken >= 1.0) return 0.0;
    if (a.units.size() < 2 || b.units.size() != a.units.size()) return std::nullopt;
    std::vector<double> left = a.deviations(rate_a);
    const std::vector<double> other = b.deviations(rate_b);
    for (std::size_t k = 0; k < left.size(); ++k) left[k] -= other[k];
    return error_of_mean(left, a.part_taken);
}

std::uint64_t warps_of(const Simulation& sum) {
    std::uint64_t all = 0;
    for (const std::uint64_t count : sum.warp_times) all += count;
    return all;
}

/// Bin of the warp that `rank` warps are slower than.
double bin_of_rank(const Simulation& sum, double rank) {
    double seen = 0;
    for (std::size_t k = sum.warp_times.size(); k-- > 0;) {
        seen += static_cast<double>(sum.warp_times[k]);
        if (seen > rank) return static_cast<double>(k);
    }
    return 0.0;
}

/// Time of the slowest 0.1 % of warps, in instructions, with its error.
struct SlowTime {
    double middle, low, high;
};
SlowTime slow_time(const SimulationRow& row) {
    const double rank = 0.001 * static_cast<double>(warps_of(row.sum));
    const double spread = row.part_taken < 1.0 ? 2.0 * std::sqrt(rank) + 1.0 : 0.0;
    const auto at = [](double bin) {
        return std::exp2(bin / static_cast<double>(Simulation::bins_per_octave));
    };
    return {at(bin_of_rank(row.sum, rank) + 0.5), at(bin_of_rank(row.sum, rank + spread)),
            at(bin_of_rank(row.sum, std::max(0.0, rank - spread)) + 1.0)};
}

RatioFound slow_ratio(const SimulationRow& a, const SimulationRow& b) {
    const SlowTime x = slow_time(a), y = slow_time(b);
    const Interval costs = cost_range(a, b);
    return {x.middle / y.middle, {x.low / y.high * costs.low, x.high / y.low * costs.high}, {}};
}

/// Whether its launches have a ray for every lane that the machine holds: else what a schedule
/// takes says more of the launch than of the kernel.
bool fills_machine(const SimulationRow& row) {
    const MachineModel& machine = row.options.machine;
    return row.sum.rays >=
           row.sum.launches * std::uint64_t{machine.multiprocessors} * machine.resident_lanes;
}

RatioFound rate_ratio(const SimulationRow& a, const SimulationRow& b, Figure figure) {
    const auto rate_of = [figure](const SimulationRow& row) {
        return figure == Figure::tightest    ? row.tightest_rate()
               : figure == Figure::scheduled ? &SimulatedRates::scheduled
                                             : &SimulatedRates::bound;
    };
    const auto rate_a = rate_of(a), rate_b = rate_of(b);
    const SimulatedRates x = a.rates(), y = b.rates();
    const bool instructions = figure == Figure::instructions;
    RatioFound found;
    found.ratio =
        instructions
            ? static_cast<double>(a.sum.instructions) / static_cast<double>(a.sum.rays) /
                  (static_cast<double>(b.sum.instructions) / static_cast<double>(b.sum.rays)) *
                  b.correction() / a.correction()
            : x.*rate_a / (y.*rate_b);
    const auto needs_full = [](const SimulationRow& row, double SimulatedRates::*of) {
        return of == &SimulatedRates::scheduled && !fills_machine(row);
    };
    if (!instructions && (needs_full(a, rate_a) || needs_full(b, rate_b))) {
        found.needs = "needs launches that fill the machine";
        return found;
    }
    const std::optional<double> error = paired_error(a, rate_a, b, rate_b);
    if (!error) {
        found.needs = "needs two parts of launches or more";
        return found;
    }
    // A rate is one over instructions.
    const Interval costs = instructions ? cost_range(a, b) : cost_range(b, a);
    found.error = {*found.ratio * costs.low * std::max(0.0, 1.0 - 2.0 * *error),
                   *found.ratio * costs.high * (1.0 + 2.0 * *error)};
    return found;
}

}  // namespace

RatioFound ratio_of(const SimulationRow& a, const SimulationRow& b, Figure figure) {
    if (a.sum.instructions == 0 || b.sum.instructions == 0)
        return {.ratio = std::nullopt, .needs = "needs rays"};
    if (figure == Figure::scheduled && !(a.whole_launches && b.whole_launches))
        return {.ratio = std::nullopt, .needs = "needs whole launches"};
    return figure == Figure::slowest_warps ? slow_ratio(a, b) : rate_ratio(a, b, figure);
}

}  // namespace raydix::cli
