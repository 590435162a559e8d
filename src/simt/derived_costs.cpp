// The rule, and the counts that scripts/sass_costs made.
#include "simt/derived_costs.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "simt/op.h"

namespace raydix {
namespace {

constexpr std::array<std::string_view, kind_count> names{
    "newer",   "rejoin", "move", "minimum", "multiply", "reciprocal", "memory",
    "address", "branch", "vote", "count",   "shuffle",  "arithmetic", "exact"};

struct KindCounts {
    std::string_view kernel;
    Op op;
    std::uint32_t places;
    std::array<std::uint32_t, kind_count> of;
};

#define RAYDIX_SM90_KINDS(kernel, op, places, ...) \
    KindCounts{kernel, Op::op, places, {__VA_ARGS__}},
constexpr KindCounts kind_table[] = {
#include "simt/sm90_kinds.inc"
};
#undef RAYDIX_SM90_KINDS

double factor_of(const KindFactors& factors, Op op, std::size_t kind) {
    if (op == Op::ballot && kind == std::size_t(InstructionKind::vote)) return factors.ballot;
    if (op == Op::rank && kind == std::size_t(InstructionKind::count)) return factors.rank;
    if (op == Op::exchange_ray && kind == std::size_t(InstructionKind::memory))
        return factors.shared;
    return factors.of[kind];
}

OperationCost cost_of(const KindFactors& factors, const KindCounts& counts) {
    double sum = 0, most = 0;
    std::string origin;
    for (std::size_t kind = 0; kind < kind_count; ++kind) {
        const double issued = counts.of[kind] * factor_of(factors, counts.op, kind);
        const bool uncertain = kind == std::size_t(InstructionKind::move) ||
                               kind == std::size_t(InstructionKind::rejoin);
        sum += issued;
        most += uncertain ? counts.of[kind] : issued;
        if (issued > 0)
            origin += (origin.empty() ? "" : ", ") + std::to_string(counts.of[kind]) + " " +
                      std::string(names[kind]);
    }
    const auto rounded = [&](double total) {
        return static_cast<std::uint32_t>(std::lround(total / counts.places));
    };
    OperationCost cost{
        std::string(op_name(counts.op)), rounded(sum),
        std::string(factors.machine) + " from sm_90: " + origin +
            (counts.places > 1 ? ", at " + std::to_string(counts.places) + " places" : ""),
        std::string(counts.kernel)};
    cost.most = rounded(most);
    return cost;
}

}  // namespace

std::array<std::string_view, kind_count> instruction_kind_names() { return names; }

std::vector<OperationCost> derived_costs(const KindFactors& factors) {
    std::vector<OperationCost> costs;
    for (const WarpKernel kernel : warp_kernels())
        for (const std::string_view operation : op_names) {
            const auto* found =
                std::find_if(std::begin(kind_table), std::end(kind_table), [&](const auto& c) {
                    return c.kernel == warp_kernel_name(kernel) && op_name(c.op) == operation;
                });
            if (found != std::end(kind_table))
                costs.push_back(cost_of(factors, *found));
            else
                costs.push_back({std::string(operation), 0, "none of its own in this kernel",
                                 std::string(warp_kernel_name(kernel))});
        }
    return costs;
}

}  // namespace raydix
