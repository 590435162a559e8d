// Sorted keys -> common prefixes of neighbours, one byte each: all that the shape of the radix tree
// depends on. keys [n] -> prefixes [n - 1].
#pragma once

#include <raydix/buffer.h>

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "exec/parallel.h"
#include "tree/radix_tree.h"

namespace raydix {

inline constexpr std::size_t word_bits = 64;  // nodes that are kept are bits of such words

/// prefixes[i] = 1 + common prefix of keys i and i + 1, so that 0 can mean "outside". At most 1 +
/// 63 + 31. `padding` zeros stand before and behind: scans may look past the ends.
class NeighbourPrefixes {
public:
    static constexpr std::size_t padding = 256 + 64;

    /// Room for the prefixes of `count` keys, which the caller sets; count > 0.
    NeighbourPrefixes(std::size_t count, Buffer<std::uint8_t>& memory) {
        memory.reset(count + 2 * padding);
        std::memset(memory.data(), 0, padding);
        bytes_ = memory.data() + padding;
        end_at(count);
    }
    template <class Key>
    NeighbourPrefixes(const SortedKeys<Key>& keys, Buffer<std::uint8_t>& memory)
        : NeighbourPrefixes(keys.count, memory) {
        for_each_index(keys.count - 1,
                       [&](std::size_t i) { set(i, keys.keys[i], keys.keys[i + 1]); });
    }
    /// The keys at i and i + 1.
    template <class Key>
    void set(std::size_t i, Key a, Key b) const {
        const auto k = static_cast<std::int64_t>(i);
        bytes_[i] = static_cast<std::uint8_t>(1 + SortedKeys<Key>::prefix_of(a, b, k, k + 1));
    }
    /// Only the first `count` keys belong to the tree, no more than there is room for.
    void end_at(std::size_t count) {
        count_ = count;
        std::memset(bytes_ + count - 1, 0, padding + 1);
    }
    /// Number of keys.
    [[nodiscard]] std::size_t count() const { return count_; }
    /// Index -1 is the byte before the first.
    [[nodiscard]] const std::uint8_t* at(std::int64_t i) const { return bytes_ + i; }

private:
    std::uint8_t* bytes_ = nullptr;
    std::size_t count_ = 0;
};

}  // namespace raydix
