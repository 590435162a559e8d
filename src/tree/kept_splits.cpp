#include "tree/kept_splits.h"

#include <array>

#include "base/bits.h"
#include "exec/parallel.h"
#include "exec/scan.h"
#include "tree/byte_scan.h"

namespace raydix {
namespace {

/// How many prefixes beside split k are longer than its own, without a gap, sixteen splits at a
/// time; no more than `limit` a side are looked at.
std::uint32_t kept_sixteen(const std::uint8_t* prefixes, int limit) {
    const Bytes16 own = Bytes16::load(prefixes);
    std::uint32_t left = 0xFFFFu, right = 0xFFFFu;  // the run goes on so far
    // reached[k]: k longer neighbours on the left; then the right side adds its own.
    std::array<std::uint32_t, 256> reached;
    reached[0] = 0xFFFFu;
    for (int k = 1; k <= limit; ++k) {
        left &= ~not_above_mask(Bytes16::load(prefixes - k), own);
        reached[static_cast<std::size_t>(k)] = left;
    }
    std::uint32_t kept = reached[static_cast<std::size_t>(limit)];
    for (int k = 1; k <= limit; ++k) {
        right &= ~not_above_mask(Bytes16::load(prefixes + k), own);
        kept |= right & reached[static_cast<std::size_t>(limit - k)];
    }
    return kept & 0xFFFFu;
}

}  // namespace

std::uint32_t mark_kept_splits(const NeighbourPrefixes& prefixes, std::size_t splits, int max_leaf,
                               Buffer<std::uint64_t>& bits, Buffer<std::uint32_t>& before_word) {
    // A node of l + 1 keys on the left and r + 1 on the right is kept iff l + r > max_leaf - 2.
    const int limit = max_leaf - 1;
    const std::size_t words = (splits + word_bits - 1) / word_bits;
    bits.reset(words + 1);  // one more word: who reads on from the last bit finds zeros
    before_word.reset(words + 1);
    for_each_index(
        words,
        [&](std::size_t w) {
            std::uint64_t word = 0;
            for (std::size_t i = 0; i < word_bits; i += 16)
                word |= std::uint64_t{kept_sixteen(
                            prefixes.at(static_cast<std::int64_t>(w * word_bits + i)), limit)}
                        << i;
            if ((w + 1) * word_bits > splits)
                word &= ~std::uint64_t{0} >> ((w + 1) * word_bits - splits);
            bits[w] = word;
            before_word[w] = static_cast<std::uint32_t>(count_ones(word));
        },
        64);
    bits[words] = 0;
    before_word[words] = 0;
    return exclusive_scan(before_word.span());
}

}  // namespace raydix
