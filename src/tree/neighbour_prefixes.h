// Sorted keys -> common prefixes of neighbours, one byte each: all that the shape of the radix tree depends on.
// keys [n] -> prefixes [n - 1].
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

    template <class Key>
    NeighbourPrefixes(const SortedKeys<Key>& keys, Buffer<std::uint8_t>& memory) {
        memory.reset(keys.count + 2 * padding);
        std::memset(memory.data(), 0, padding);
        bytes_ = memory.data() + padding;
        std::memset(bytes_ + keys.count - 1, 0, padding + 1);
        for_each_index(keys.count - 1, [&](std::size_t i) {
            const auto k = static_cast<std::int64_t>(i);
            bytes_[i] = static_cast<std::uint8_t>(1 + keys.common_prefix(k, k + 1));
        });
    }
    /// Index -1 is the byte before the first.
    [[nodiscard]] const std::uint8_t* at(std::int64_t i) const { return bytes_ + i; }

private:
    std::uint8_t* bytes_ = nullptr;
};

}  // namespace raydix
