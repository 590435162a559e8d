// Stable parallel sort of keys with their positions. keys [n] -> keys [n] ascending, order [n]:
// where each came from.
#pragma once

#include <raydix/buffer.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace raydix {

template <class Key>
struct SortRecord {
    Key key;
    std::uint32_t position;
};

/// Where keys come from, so that they need not lie in memory: keys [begin, end) to out[0], out[1],
/// ... Each is asked for twice, with the same answer.
template <class Key>
using LoadKeys = std::function<void(std::size_t begin, std::size_t end, Key* out)>;
/// Where they go, a run of neighbours at a time, while they are in a cache: sorted positions from
/// `begin` on.
template <class Key>
using TakeSorted = std::function<void(std::size_t begin, std::span<const SortRecord<Key>>)>;

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

/// The same for keys that are made and used on the way. Afterwards scratch.records holds all in
/// order; returns where the runs that `take` got begin, ascending.
template <class Key>
std::vector<std::size_t> sort_on_the_way(std::size_t n, int key_bits, const LoadKeys<Key>& load,
                                         const TakeSorted<Key>& take, SortScratch<Key>& scratch);

extern template std::vector<std::size_t> sort_on_the_way(std::size_t, int,
                                                         const LoadKeys<std::uint32_t>&,
                                                         const TakeSorted<std::uint32_t>&,
                                                         SortScratch<std::uint32_t>&);
extern template std::vector<std::size_t> sort_on_the_way(std::size_t, int,
                                                         const LoadKeys<std::uint64_t>&,
                                                         const TakeSorted<std::uint64_t>&,
                                                         SortScratch<std::uint64_t>&);
extern template void sort_keys(std::span<std::uint32_t>, std::span<std::uint32_t>, int,
                               SortScratch<std::uint32_t>&);
extern template void sort_keys(std::span<std::uint64_t>, std::span<std::uint32_t>, int,
                               SortScratch<std::uint64_t>&);

}  // namespace raydix
