// How many levels of split lists fit into the memory that there may be.
#include "tree/lauterbach.h"

#include <raydix/error.h>

#include <algorithm>
#include <limits>
#include <string>

namespace raydix {

std::uint32_t lauterbach_band_width(std::uint32_t n, std::uint32_t levels,
                                    std::uint64_t memory_limit) {
    const auto needed = [&](std::uint32_t width) {
        return scratch_bytes<LauterbachScratch>(n, levels, width);
    };
    // The sort looks at four bits of a level, and places of splits are 32-bit numbers.
    constexpr std::uint32_t sortable = 16;
    const std::uint32_t numbered = std::numeric_limits<std::uint32_t>::max() / std::max(n, 1u);
    std::uint32_t width = std::min({sortable, numbered, levels});
    while (width > 1 && needed(width) > memory_limit) --width;
    if (needed(width) > memory_limit)
        throw InputError("builder lauterbach needs " + std::to_string(needed(width)) +
                         " bytes for the split lists of " + std::to_string(n) +
                         " primitives; the limit is " + std::to_string(memory_limit));
    return width;
}

}  // namespace raydix
