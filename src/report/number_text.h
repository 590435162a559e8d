// Numbers -> text for people: thousands grouped, as many digits as say something. What is not
// finite becomes a dash.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace raydix::report {

/// 12345678 -> "12,345,678".
[[nodiscard]] std::string grouped(std::uint64_t n);

/// Exactly `decimals` digits behind the point, the whole part grouped.
[[nodiscard]] std::string with_decimals(double value, int decimals);

/// At least `digits` digits that count: 0.01234 -> "0.0123", 1234.5 -> "1,235" (three). Beyond 1e15
/// and below 1e-6 as a power of ten.
[[nodiscard]] std::string significant(double value, int digits = 3);

/// Short, for axes: 1000 -> "1k", 2500000 -> "2.5M", 0.05 -> "0.05".
[[nodiscard]] std::string short_number(double value);

/// 0.423 -> "42.3 %".
[[nodiscard]] std::string percent(double part);

/// How many digits behind the point a column of such values needs, so that the smallest still has
/// two that count; 0 to 4, and none where all are whole.
[[nodiscard]] int decimals_for(const std::vector<double>& values);

}  // namespace raydix::report
