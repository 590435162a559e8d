// Whether a sanitizer slows the tests down. `thorough` (support.h) is 1 on an emulated processor
// too, where what asks this keeps all of its cases.
#pragma once

namespace raydix::test {

#if defined(RAYDIX_SANITIZED)
inline constexpr bool sanitized = true;
#else
inline constexpr bool sanitized = false;
#endif

}  // namespace raydix::test
