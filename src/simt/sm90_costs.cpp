// The table that scripts/sass_costs made.
#include "simt/cost_model.h"
#include "simt/op.h"

namespace raydix {
namespace {

struct KernelCosts {
    std::string_view kernel;
    OpCosts costs;
};

#define RAYDIX_SM90_COSTS(kernel, ...) KernelCosts{kernel, {__VA_ARGS__}},
constexpr KernelCosts table[] = {
#include "simt/sm90_costs.inc"
};
#undef RAYDIX_SM90_COSTS

}  // namespace

std::vector<OperationCost> sm90_costs() {
    std::vector<OperationCost> costs;
    for (const KernelCosts& row : table)
        for (std::size_t k = 0; k < op_count; ++k)
            costs.push_back(
                {std::string(op_names[k]), row.costs[k],
                 "SASS of sm_90, " RAYDIX_SM90_COMPILER ", kernel " + std::string(row.kernel),
                 std::string(row.kernel)});
    return costs;
}

}  // namespace raydix
