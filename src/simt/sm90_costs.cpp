// The table that scripts/sass_costs made.
#include "simt/cost_model.h"
#include "simt/op.h"

namespace raydix {
namespace {

struct KernelCosts {
    std::string_view kernel;
    OpCosts costs, half_rate;
};

#define RAYDIX_SM90_LIST(...) \
    { __VA_ARGS__ }
#define RAYDIX_SM90_COSTS(kernel, costs, half_rate) \
    KernelCosts{kernel, RAYDIX_SM90_LIST costs, RAYDIX_SM90_LIST half_rate},
constexpr KernelCosts table[] = {
#include "simt/sm90_costs.inc"
};
#undef RAYDIX_SM90_COSTS
#undef RAYDIX_SM90_LIST

}  // namespace

std::vector<OperationCost> sm90_costs() {
    std::vector<OperationCost> costs;
    for (const KernelCosts& row : table)
        for (std::size_t k = 0; k < op_count; ++k)
            costs.push_back({.operation = std::string(op_names[k]),
                             .instructions = row.costs[k],
                             .origin = "SASS of sm_90, " RAYDIX_SM90_COMPILER ", kernel " +
                                       std::string(row.kernel),
                             .kernel = std::string(row.kernel),
                             .half_rate = row.half_rate[k]});
    return costs;
}

}  // namespace raydix
