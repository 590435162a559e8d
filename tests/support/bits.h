// Hits that agree to the last bit; of floats base/same_bits.h.
#pragma once

#include <raydix/types.h>

#include <cstring>

namespace raydix::test {

inline bool same_bits(const Hit& a, const Hit& b) { return std::memcmp(&a, &b, sizeof(Hit)) == 0; }

}  // namespace raydix::test
