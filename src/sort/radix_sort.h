// Stable parallel sort of keys with their positions. keys [n] -> keys [n] ascending, order [n]:
// where each came from.
#pragma once

#include <raydix/buffer.h>

#include <cstdint>
#include <span>

namespace raydix {

template <class Key>
struct SortRecord {
    Key key;
    std::uint32_t position;
};

/// Kept between calls so that sorting again allocates nothing.
template <class Key>
struct SortScratch {
    Buffer<SortRecord<Key>> records;  // may view memory of the caller; made larger if too small
    Buffer<SortRecord<Key>> spare;    // only if one bucket holds most of the input
    Buffer<std::uint32_t> histogram;
};

/// Equal keys keep their order. Only the low `key_bits` bits of a key may be set.
/// Most significant digit first over all threads, then each bucket by itself in its core's cache:
/// two counting passes over just enough further bits to tell almost all keys apart, and an
/// insertion sort of the few that are left.
template <class Key>
void sort_keys(std::span<Key> keys, std::span<std::uint32_t> order, int key_bits,
               SortScratch<Key>& scratch);

extern template void sort_keys(std::span<std::uint32_t>, std::span<std::uint32_t>, int,
                               SortScratch<std::uint32_t>&);
extern template void sort_keys(std::span<std::uint64_t>, std::span<std::uint32_t>, int,
                               SortScratch<std::uint64_t>&);

}  // namespace raydix
