// Which words of a vector go where when those with a bit set move to the front.
#pragma once

#include <array>
#include <cstdint>

namespace raydix {

/// [bits of 8 words] -> the words with a set bit, ascending, then word 0.
inline constexpr auto words_of_8 = [] {
    std::array<std::array<std::uint8_t, 8>, 256> table{};
    for (std::uint32_t bits = 0; bits < 256; ++bits)
        for (std::uint8_t word = 0, at = 0; word < 8; ++word)
            if ((bits >> word & 1) != 0) table[bits][at++] = word;
    return table;
}();

/// [bits of 4 words] -> the bytes of those with a set bit, ascending, then byte 0.
struct alignas(16) ByteOrder {
    std::array<std::uint8_t, 16> bytes;
    [[nodiscard]] constexpr const std::uint8_t* data() const { return bytes.data(); }
};
inline constexpr auto bytes_of_4 = [] {
    std::array<ByteOrder, 16> table{};
    for (std::uint32_t bits = 0; bits < 16; ++bits)
        for (std::uint8_t byte = 0, at = 0; byte < 16; ++byte)
            if ((bits >> byte / 4 & 1) != 0) table[bits].bytes[at++] = byte;
    return table;
}();

/// [bits of up to 4 double words] -> bits of their words.
inline constexpr auto twice_each_bit = [] {
    std::array<std::uint8_t, 16> table{};
    for (std::uint32_t bits = 0; bits < 16; ++bits)
        for (std::uint32_t k = 0; k < 4; ++k)
            if ((bits >> k & 1) != 0) table[bits] |= static_cast<std::uint8_t>(3u << 2 * k);
    return table;
}();

}  // namespace raydix
