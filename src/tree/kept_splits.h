// Which splits between neighbouring keys stay inner nodes when subtrees of up to max_leaf keys
// become leaves, from the prefixes alone. prefixes [n - 1] -> bits [n - 1] in words, kept splits
// before each word.
#pragma once

#include <raydix/buffer.h>

#include <cstddef>
#include <cstdint>

#include "tree/neighbour_prefixes.h"

namespace raydix {

/// Bit s: the node that splits between keys s and s + 1 holds more than max_leaf keys. Its range
/// goes as far to each side as prefixes are longer than its own. Returns the number of bits set.
std::uint32_t mark_kept_splits(const NeighbourPrefixes& prefixes, std::size_t splits, int max_leaf,
                               Buffer<std::uint64_t>& bits, Buffer<std::uint32_t>& before_word);

}  // namespace raydix
