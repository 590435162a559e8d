#include "report/number_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace raydix::report {
namespace {

const char* const en_dash = "\xE2\x80\x93";
const char* const minus = "\xE2\x88\x92";

/// Of the first digit, after rounding to `digits`: 0.9999 with three is 1.00.
int exponent_of(double value, int digits) {
    const std::string text = fmt::format("{:.{}e}", value, digits - 1);
    return std::stoi(text.substr(text.find('e') + 1));
}

/// "-12345.6" -> "−12,345.6"
std::string group_digits(std::string digits) {
    const bool negative = digits[0] == '-';
    if (negative) digits.erase(0, 1);
    const std::size_t point = std::min(digits.find('.'), digits.size());
    for (std::size_t at = point; at > 3; at -= 3) digits.insert(at - 3, 1, ',');
    const bool zero = digits.find_first_not_of("0.,") == std::string::npos;
    return negative && !zero ? fmt::format("{}{}", minus, digits) : digits;
}

/// Without the zeros that end it: "2.50" -> "2.5".
std::string without_zeros(std::string digits) {
    if (digits.find('.') == std::string::npos) return digits;
    digits.erase(digits.find_last_not_of('0') + 1);
    if (digits.back() == '.') digits.pop_back();
    return digits;
}

}  // namespace

std::string grouped(std::uint64_t n) { return group_digits(std::to_string(n)); }

std::string with_decimals(double value, int decimals) {
    if (!std::isfinite(value)) return en_dash;
    if (std::fabs(value) >= 1e15) return significant(value);
    return group_digits(fmt::format("{:.{}f}", value, decimals));
}

std::string significant(double value, int digits) {
    if (!std::isfinite(value)) return en_dash;
    if (value == 0) return "0";
    const double size = std::fabs(value);
    if (size >= 1e15 || size < 1e-6) return fmt::format("{:.{}e}", value, digits - 1);
    return group_digits(
        fmt::format("{:.{}f}", value, std::max(0, digits - 1 - exponent_of(value, digits))));
}

std::string short_number(double value) {
    if (!std::isfinite(value)) return en_dash;
    if (value == 0) return "0";
    constexpr std::array<std::pair<double, const char*>, 4> units{
        {{1e12, "T"}, {1e9, "G"}, {1e6, "M"}, {1e3, "k"}}};
    const double size = std::fabs(value);
    if (size >= 1e15 || size < 1e-4) return fmt::format("{:.3g}", value);
    for (const auto& [unit, name] : units)
        if (size >= unit)
            return group_digits(without_zeros(fmt::format("{:.3f}", value / unit))) + name;
    return group_digits(without_zeros(fmt::format("{:.{}f}", value, size < 0.01 ? 5 : 3)));
}

std::string percent(double part) {
    return std::isfinite(part) ? with_decimals(100 * part, 1) + " %" : en_dash;
}

int decimals_for(const std::vector<double>& values) {
    int decimals = 0;
    for (const double v : values)
        if (std::isfinite(v) && v != std::floor(v))
            decimals = std::max(decimals, std::clamp(1 - exponent_of(v, 2), 1, 4));
    return decimals;
}

}  // namespace raydix::report
