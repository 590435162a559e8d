// What a word of WideNode::child and CompactNode::child says.
#pragma once

#include <cstdint>

#include "layout/wide_bvh.h"

namespace raydix::child_words {

[[nodiscard]] inline bool is_leaf(std::uint32_t word) {
    return word != wide_no_child && (word & wide_leaf_bit) != 0;
}
[[nodiscard]] inline bool is_inner(std::uint32_t word) {
    return word != wide_no_child && (word & wide_leaf_bit) == 0;
}
/// Of a leaf: where its triangles begin, in lanes of blocks, and how many it holds.
[[nodiscard]] inline std::uint32_t first_place(std::uint32_t word) {
    return (word & ~wide_leaf_bit) >> 3;
}
[[nodiscard]] inline std::uint32_t leaf_size(std::uint32_t word) { return (word & 7) + 1; }

}  // namespace raydix::child_words
