// What one instruction of each kind takes on the machines of 2008 to 2012.
#include "simt/cost_model.h"

#include "simt/derived_costs.h"

namespace raydix {
namespace {

// In the order of InstructionKind.
// newer, rejoin, move, minimum, multiply, reciprocal, memory, address, branch, vote, count,
// shuffle, arithmetic, exact

/// Multiplications and reciprocals go to the second pipeline at the same time as other instructions
/// (dual issue, taken as optimal: Aila and Laine 2009, section 2). There is no ballot and no count
/// of ones: a sum over the warp through shared memory gives both, in five steps of load, addition,
/// store and selection, and a move of the result. Shared memory hands a lane 4 bytes at a time.
constexpr KindFactors gt200{"GT200", {0, 0, 0, 1, 0, 0, 1, 1, 1, 1, 0, 2, 1, 0}, 21, 21, 4};
/// ENUM, a lane's rank among those with a set flag, and POPC, their number.
constexpr KindFactors gt200_enum_popc{
    "GT200 with ENUM and POPC", {0, 0, 0, 1, 0, 0, 1, 1, 1, 1, 0, 2, 1, 0}, 1, 1, 4};
/// One pipeline for all, shared memory as before; ballot and count of ones; values of other lanes
/// through shared memory.
constexpr KindFactors fermi{"Fermi", {0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 2, 1, 0}, 1, 1, 4};
/// Shuffles; 8 bytes of shared memory a lane at a time; minima and maxima of three operands, which
/// take two thirds of those of two.
constexpr KindFactors kepler{"Kepler", {0, 0, 0, 2.0 / 3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0}, 1, 1, 2};

}  // namespace

std::vector<OperationCost> gt200_costs() { return derived_costs(gt200); }
std::vector<OperationCost> gt200_enum_popc_costs() { return derived_costs(gt200_enum_popc); }
std::vector<OperationCost> fermi_costs() { return derived_costs(fermi); }
std::vector<OperationCost> kepler_costs() { return derived_costs(kepler); }

}  // namespace raydix
