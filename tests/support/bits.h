// Answers that are to agree to the last bit.
#pragma once

#include <raydix/types.h>

#include <bit>
#include <cstdint>
#include <cstring>

namespace raydix::test {

inline bool same_float(float a, float b) {
    return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b);
}
inline bool same_bits(const Hit& a, const Hit& b) { return std::memcmp(&a, &b, sizeof(Hit)) == 0; }

}  // namespace raydix::test
