// Costs of machines whose compilers are gone: derived by one rule from what the kernels compile to
// for sm_90, kind of instruction by kind of instruction (docs/costs.md).
#pragma once

#include <raydix/simulate.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace raydix {

/// Kinds of sm_90 instructions, as scripts/sass_costs sorts them.
enum class InstructionKind : std::uint8_t {
    newer,       // 64-bit halves, constants into registers, and what threads that part need since
                 // Volta
    rejoin,      // where lanes meet again: a flag of an instruction before Volta
    move,        // which a register allocator may remove
    minimum,     // minimum or maximum
    multiply,    // float32 multiplication
    reciprocal,  // approximate
    memory,      // a load or store of up to 16 bytes
    address,     // the computation of one
    branch,      // and the note of where its lanes will meet
    vote,        // any, all, or the mask of the lanes
    count,       // ones in a word
    shuffle,     // a value from another lane
    arithmetic,  // addition, multiply-add, comparison, selection, logic
    exact,       // what makes a quotient exact; Aila and Laine's release does without
    kinds
};
inline constexpr std::size_t kind_count = static_cast<std::size_t>(InstructionKind::kinds);

/// Names of the kinds, in order.
[[nodiscard]] std::array<std::string_view, kind_count> instruction_kind_names();

/// Native instructions that take an issue slot, for one of each kind.
struct KindFactors {
    std::string_view machine;
    std::array<double, kind_count> of;
    double ballot;  // a vote whose mask is used
    double rank;    // a count of ones that gives a lane's rank
    double shared;  // 16 bytes of shared memory a lane
};

/// sum of count * factor / places, rounded, for each operation of each kernel. The range's upper
/// end, OperationCost::most, has moves and rejoins as one instruction each.
[[nodiscard]] std::vector<OperationCost> derived_costs(const KindFactors& factors);

}  // namespace raydix
