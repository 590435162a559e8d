// Each cluster's nearest neighbour within a radius of its place in the list: box lanes -> offsets.
#pragma once

#include <cstdint>

#include "tree/ploc.h"

namespace raydix {

inline constexpr std::uint32_t max_radius = 16;
/// How many places one call of `find_partners` decides.
inline constexpr std::uint32_t partner_block = 512;

/// For places [begin, end), at most partner_block, begin a multiple of 4: partners[i] is the offset
/// to the cluster that i merges with, or 0. The nearest is the one with the least (area of the
/// union, distance in the list, tie_goes_right); two merge if each is the other's nearest.
void find_partners(const BoxLanes& boxes, std::uint32_t begin, std::uint32_t end,
                   std::uint32_t radius, std::int8_t* partners);

/// The same with eight places at once or four; the answer does not depend on it. `wide` only if
/// has_wide_search().
void find_partners(const BoxLanes& boxes, std::uint32_t begin, std::uint32_t end,
                   std::uint32_t radius, std::int8_t* partners, bool wide);
[[nodiscard]] bool has_wide_search();

}  // namespace raydix
