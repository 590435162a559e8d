// Options that are numbers, checked: how many threads, distances, and enumerations, which a caller
// may have cast from anything.
#pragma once

#include <raydix/error.h>

#include <charconv>
#include <cstdint>
#include <string>
#include <string_view>

namespace raydix {

inline constexpr int max_threads = 1024;

/// Throws InputError below 0 and above max_threads. with_threads asks it for every call; only a
/// call that may return before that asks it itself.
inline void check_threads(int threads) {
    if (threads < 0 || threads > max_threads)
        throw InputError("option threads is " + std::to_string(threads) + "; it must be 0 to " +
                         std::to_string(max_threads) + ", where 0 is all the machine has");
}

/// A number for a message, in as few digits as tell it from all others; std::to_string would make
/// -0.000000 of -1e-9.
template <class Scalar>
std::string number_text(Scalar value) {
    char digits[32];
    return {digits, std::to_chars(digits, digits + sizeof digits, value).ptr};
}

/// The end of a message that names the first of `faulty` elements.
inline std::string others_too(std::uint64_t faulty) {
    return faulty < 2    ? ""
           : faulty == 2 ? ", as is 1 other"
                         : ", as are " + std::to_string(faulty - 1) + " others";
}

/// Throws InputError unless `value` is at least 0. `what`: its name.
template <class Scalar>
void check_not_negative(std::string_view what, Scalar value) {
    if (!(value >= 0))
        throw InputError(std::string(what) + " is " + number_text(value) +
                         "; it must be 0 or more");
}

/// Throws InputError unless `value` is one of 0 to `last`.
template <class Enum>
void check_enum(const char* option, Enum value, Enum last) {
    const auto number = static_cast<std::int64_t>(value), highest = static_cast<std::int64_t>(last);
    if (number < 0 || number > highest)
        throw InputError(std::string("option ") + option + " is " + std::to_string(number) +
                         "; it must be 0 to " + std::to_string(highest));
}

}  // namespace raydix
