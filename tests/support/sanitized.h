// Whether a sanitizer slows the tests down. `thorough` (support.h) is 1 on an emulated processor
// too, where what asks this keeps all of its cases.
#pragma once

#include <cstddef>

namespace raydix::test {

#if defined(RAYDIX_SANITIZED)
inline constexpr bool sanitized = true;
#else
inline constexpr bool sanitized = false;
#endif

/// n in plain builds; under sanitizers n / by, rounded up.
constexpr std::size_t fewer(std::size_t n, std::size_t by) {
    return sanitized ? (n + by - 1) / by : n;
}

}  // namespace raydix::test
