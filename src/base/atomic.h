// The meeting point of bottom-up passes, where the second child to arrive goes on, and counters
// that hand out places.
#pragma once

#include <cstdint>

#include "base/device_words.h"
#include "base/hd.h"

namespace raydix {

/// Leaves `value` (not 0) at `meeting` and returns what lay there: 0 for the first to come, who
/// stops. The second gets the first one's value; there is no third. Acquire-release on both sides:
/// the second sees all that the first wrote before.
RAYDIX_HD inline std::uint8_t arrive(std::uint8_t& meeting, std::uint8_t value) {
    return words::exchange_zero(meeting, value);
}

/// The same for a word: returns what lay there before.
RAYDIX_HD inline std::uint32_t arrive(std::uint32_t& meeting, std::uint32_t value) {
    return words::exchange(meeting, value);
}

/// Takes `count` places of a list whose length is `counter`; returns the first. Order is nobody's
/// promise.
RAYDIX_HD inline std::uint32_t claim(std::uint32_t& counter, std::uint32_t count) {
    return words::fetch_add(counter, count);
}

}  // namespace raydix
