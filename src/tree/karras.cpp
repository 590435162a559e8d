// The hierarchy of karras.h. The paper compares whole keys; here the common prefixes of neighbours
// are kept as one byte each, so that the short ranges, which are nearly all, are found by scanning
// bytes. Long ones use the keys.
#include "tree/karras.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "exec/parallel.h"
#include "exec/scan.h"
#include "tree/byte_scan.h"
#include "tree/radix_tree.h"

namespace raydix {
namespace {

constexpr std::size_t word_bits = 64;
constexpr std::uint32_t scan_limit =
    128;  // bytes looked at before galloping, where the paper starts too

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

/// A radix node holds more than max_leaf keys iff the max_leaf prefixes on its inner side all
/// exceed the outer one. Bit k of the result speaks of the node whose own prefix is prefixes[k].
std::uint32_t kept_bits(const std::uint8_t* prefixes, std::size_t max_leaf) {
    Bytes16 to_right = Bytes16::load(prefixes), to_left = Bytes16::load(prefixes - 1);
    for (std::size_t k = 1; k < max_leaf; ++k) {
        to_right = min_of(to_right, Bytes16::load(prefixes + k));
        to_left = min_of(to_left, Bytes16::load(prefixes - 1 - k));
    }
    const std::uint32_t few_right = not_above_mask(to_right, Bytes16::load(prefixes - 1));
    const std::uint32_t few_left = not_above_mask(to_left, Bytes16::load(prefixes));
    return ~(few_right & few_left) & 0xFFFFu;
}

std::uint64_t kept_word(const std::uint8_t* prefixes, std::size_t max_leaf) {
    std::uint64_t word = 0;
    for (std::size_t i = 0; i < word_bits; i += 16)
        word |= std::uint64_t{kept_bits(prefixes + i, max_leaf)} << i;
    return word;
}

/// Fills bits and counts for radix nodes [0, n - 1); returns how many are kept.
std::uint32_t mark_kept(const NeighbourPrefixes& prefixes, std::size_t radix_nodes, int max_leaf,
                        HierarchyScratch& scratch) {
    const std::size_t words = (radix_nodes + word_bits - 1) / word_bits;
    scratch.kept_bits.reset(words);
    scratch.kept_before.reset(words + 1);
    for_each_index(
        words,
        [&](std::size_t w) {
            std::uint64_t word = kept_word(prefixes.at(static_cast<std::int64_t>(w * word_bits)),
                                           static_cast<std::size_t>(max_leaf));
            if ((w + 1) * word_bits > radix_nodes)
                word &= ~std::uint64_t{0} >> ((w + 1) * word_bits - radix_nodes);
            scratch.kept_bits[w] = word;
            scratch.kept_before[w] = static_cast<std::uint32_t>(count_ones(word));
        },
        64);
    return exclusive_scan(scratch.kept_before.span().first(words));
}

/// As find_range, with the bytes first.
template <class Key>
RadixRange find_range(const SortedKeys<Key>& keys, const NeighbourPrefixes& prefixes,
                      std::uint32_t node) {
    const std::uint8_t before = *prefixes.at(std::int64_t{node} - 1), behind = *prefixes.at(node);
    std::uint32_t first = node, last = node;
    if (behind > before) {
        const std::uint32_t length = count_above(prefixes.at(node), scan_limit, before);
        if (length == scan_limit) return find_range(keys, node);
        last = node + length;
    } else {
        const std::uint32_t length = count_above_backward(prefixes.at(node), scan_limit, behind);
        if (length == scan_limit) return find_range(keys, node);
        first = node - length;
    }
    // The lowest prefix of a range is unique, and the split stands there.
    const auto lowest = static_cast<std::uint8_t>(1 + keys.common_prefix(first, last));
    return {first, last, first + find_byte(prefixes.at(first), lowest)};
}

}  // namespace

template <class Key>
std::uint32_t build_karras(std::span<const Key> keys, int max_leaf, Buffer<BvhNode>& nodes,
                           HierarchyScratch& scratch) {
    const SortedKeys<Key> sorted{keys.data(), static_cast<std::uint32_t>(keys.size())};
    std::uint32_t inner = 0;
    if (keys.size() > static_cast<std::size_t>(max_leaf)) {
        const NeighbourPrefixes prefixes(sorted, scratch.prefixes);
        const std::size_t radix_nodes = keys.size() - 1;
        inner = mark_kept(prefixes, radix_nodes, max_leaf, scratch);
        nodes.reset(2 * std::size_t{inner} + 2);
        scratch.parent_slot.reset(inner);
        const KeptNodes kept{scratch.kept_bits.data(), scratch.kept_before.data()};
        const EmitRadixNode<> emit{kept, static_cast<std::uint32_t>(max_leaf), nodes.data(),
                                   scratch.parent_slot.data()};
        for_each_index(
            scratch.kept_bits.size(),
            [&](std::size_t w) {
                std::uint32_t rank = kept.before_word[w];
                for (std::uint64_t left = kept.bits[w]; left != 0; left &= left - 1) {
                    const auto node =
                        static_cast<std::uint32_t>(w * word_bits + std::countr_zero(left));
                    emit(rank++, find_range(sorted, prefixes, node));
                }
            },
            64);
        scratch.parent_slot[0] = 0;
    } else {
        nodes.reset(2);
    }
    const Vec3 zero{0, 0, 0};
    nodes[0] = inner ? BvhNode{zero, pair_slot(0), zero, 0} : BvhNode{zero, 0, zero, sorted.count};
    nodes[1] = BvhNode{zero, 0, zero, 0};
    return inner;
}

template std::uint32_t build_karras(std::span<const std::uint32_t>, int, Buffer<BvhNode>&,
                                    HierarchyScratch&);
template std::uint32_t build_karras(std::span<const std::uint64_t>, int, Buffer<BvhNode>&,
                                    HierarchyScratch&);

}  // namespace raydix
