// What each operation costs on each machine: native instructions that one warp issues for it.
//
// The tables of 2008-2012 are derived by counting what a step needs on that machine's instruction
// set; each count is written out below. They follow these rules: a multiply-add, a comparison, a
// select, a minimum or maximum, a reciprocal, an address and a load or store of up to 16 bytes are
// one instruction each; moves that a register allocator removes are none; loads of 16 bytes that a
// machine splits are still one. So they are on the low side, as a bound should be.
#pragma once

#include <raydix/simulate.h>

#include <string_view>
#include <vector>

namespace raydix {

/// GT200: no ballot, no count of bits, no prefix over a warp: masks and ranks go through shared
/// memory in log2(32) = 5 steps of load, add, store, select.
[[nodiscard]] std::vector<OperationCost> gt200_costs();
/// The same with the two instructions that Aila and Laine 2009 wish for: ENUM, a lane's rank among
/// those with a set flag, and POPC, their number.
[[nodiscard]] std::vector<OperationCost> gt200_enum_popc_costs();
/// Fermi: ballot, and population count of a word.
[[nodiscard]] std::vector<OperationCost> fermi_costs();
/// Kepler: shuffles, and minimum-maximum pairs that take three operands.
[[nodiscard]] std::vector<OperationCost> kepler_costs();
/// sm_90: counted in the compiled kernels by scripts/sass_costs, for each kernel (closest hit)
/// apart. A count of 0: the kernel does not have the operation, or the compiler has put it into
/// others.
[[nodiscard]] std::vector<OperationCost> sm90_costs();

}  // namespace raydix
