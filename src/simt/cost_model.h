// What each operation costs on each machine: native instructions that one warp issues for it.
//
// The tables of 2008 to 2012 are derived from what the kernels compile to for sm_90
// (simt/derived_costs.h, docs/costs.md). They are on the low side, as a bound should be.
#pragma once

#include <raydix/simulate.h>

#include <string_view>
#include <vector>

namespace raydix {

/// GT200: no ballot, no count of bits, no prefix over a warp; multiplications and reciprocals
/// beside other instructions.
[[nodiscard]] std::vector<OperationCost> gt200_costs();
/// The same with the two instructions that Aila and Laine 2009 wish for: ENUM and POPC.
[[nodiscard]] std::vector<OperationCost> gt200_enum_popc_costs();
/// Fermi: ballot, and population count of a word; one pipeline.
[[nodiscard]] std::vector<OperationCost> fermi_costs();
/// Kepler: shuffles, and minimum-maximum pairs that take three operands.
[[nodiscard]] std::vector<OperationCost> kepler_costs();
/// sm_90: counted in the compiled kernels by scripts/sass_costs, for each kernel (closest hit)
/// apart. A count of 0: the kernel does not have the operation, or the compiler has put it into
/// others.
[[nodiscard]] std::vector<OperationCost> sm90_costs();

}  // namespace raydix
