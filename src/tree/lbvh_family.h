// Rules that hold for the trees of the radix builders: they all give the same tree.
#pragma once

#include <raydix/bvh.h>

#include <bit>
#include <cstdint>

namespace raydix {

/// Builders that split sorted Morton codes at their highest differing bit.
[[nodiscard]] constexpr bool in_lbvh_family(Builder builder) {
    return builder == Builder::karras || builder == Builder::lauterbach ||
           builder == Builder::garanzha || builder == Builder::apetrei;
}

/// Whether the finished tree still divides sorted codes at each node: reinsertion moves nodes
/// elsewhere.
[[nodiscard]] constexpr bool follows_codes(const BuildOptions& options) {
    return in_lbvh_family(options.builder) && options.reinsertion_rounds == 0;
}

/// Below each split the common prefix is longer by a bit: at most `bits` times in the code, then
/// ceil(log2 n) times in the position that tells equal codes apart. n > 0.
[[nodiscard]] constexpr std::uint32_t lbvh_depth_bound(int bits, std::uint64_t n) {
    return static_cast<std::uint32_t>(bits) + static_cast<std::uint32_t>(std::bit_width(n - 1));
}

}  // namespace raydix
