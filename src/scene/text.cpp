// Text -> lines, words, float32 numbers and integers.
#include "scene/text.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <system_error>

namespace raydix {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Where a number's value lies if neither float nor double can hold it: true above, false next to
/// zero. Compares the decimal exponent of its first digit that is not 0 with 0.
bool is_huge(std::string_view number) {
    std::int64_t leading = 0;  // exponent of the first nonzero digit
    bool after_point = false, found = false;
    std::size_t i = 0;
    for (; i < number.size() && (is_digit(number[i]) || number[i] == '.' || number[i] == '-');
         ++i) {
        if (number[i] == '.') after_point = true;
        if (!is_digit(number[i])) continue;
        found = found || number[i] != '0';
        if (found && !after_point) ++leading;
        if (!found && after_point) --leading;
    }
    std::int64_t exponent = 0;
    bool negative = false;
    for (; i < number.size(); ++i) {
        if (number[i] == '-') negative = true;
        if (is_digit(number[i]))
            exponent = std::min<std::int64_t>(exponent * 10 + (number[i] - '0'), 1'000'000'000'000);
    }
    return leading + (negative ? -exponent : exponent) > 0;
}

/// Old Microsoft runtimes print 1.#INF, 1.#QNAN, 1.#IND; `text` starts at the '#'.
void take_hash_suffix(std::string_view& text, float& value) {
    const bool is_infinite = text.substr(1, 3) == "INF";
    const float special = is_infinite ? std::numeric_limits<float>::infinity()
                                      : std::numeric_limits<float>::quiet_NaN();
    value = value < 0 ? -special : special;
    while (!text.empty() && !is_blank(text.front())) text.remove_prefix(1);
}

}  // namespace

LineReader::LineReader(ByteSource& source) : source_(source) {
    source_.fill(3);
    const std::string_view start = source_.buffered();
    if (start.starts_with("\xFE\xFF") || start.starts_with("\xFF\xFE"))
        source_.fail("line 1", "UTF-16 text; only UTF-8 and ASCII are read");
    if (start.starts_with("\xEF\xBB\xBF")) source_.consume(3);
}

bool LineReader::next(std::string_view& line) {
    std::size_t length = 0;
    for (;;) {
        const std::string_view text = source_.buffered();
        while (length < text.size() && text[length] != '\n' && text[length] != '\r') ++length;
        if (length < text.size()) break;
        if (length > longest_line)
            source_.fail(fmt::format("line {}", number_ + 1), "longer than 16 MiB");
        if (!source_.fill(length + 1)) {
            if (length == 0) return false;
            break;
        }
    }
    source_.fill(length + 2);
    const std::string_view text = source_.buffered();
    line = text.substr(0, length);
    const std::string_view end = text.substr(length, 2);
    source_.consume(length + (end == "\r\n" ? 2 : end.empty() ? 0 : 1));
    ++number_;
    return true;
}

bool LineReader::next_filled(std::string_view& line) {
    while (next(line))
        if (!std::all_of(line.begin(), line.end(), is_blank)) return true;
    return false;
}

void LineReader::fail(std::string_view reason) const {
    source_.fail(fmt::format("line {}", number_), reason);
}

bool take_number(std::string_view& text, float& value) {
    const char* begin = text.data();
    const char* end = begin + text.size();
    if (text.size() > 1 && text[0] == '+' && text[1] != '-') ++begin;
    const auto [stop, error] = std::from_chars(begin, end, value);
    if (error == std::errc::invalid_argument) return false;
    if (error == std::errc::result_out_of_range) {
        const float magnitude =
            is_huge({begin, stop}) ? std::numeric_limits<float>::infinity() : 0.0f;
        value = *begin == '-' ? -magnitude : magnitude;
    }
    text.remove_prefix(static_cast<std::size_t>(stop - text.data()));
    if (text.starts_with("#")) take_hash_suffix(text, value);
    return true;
}

bool take_integer(std::string_view& text, std::int64_t& value) {
    const char* begin = text.data();
    if (text.size() > 1 && text[0] == '+' && text[1] != '-') ++begin;
    const auto [stop, error] = std::from_chars(begin, text.data() + text.size(), value);
    if (error != std::errc()) return false;
    text.remove_prefix(static_cast<std::size_t>(stop - text.data()));
    return true;
}

std::string_view Words::rest() {
    while (!rest_.empty() && parts(rest_.front())) rest_.remove_prefix(1);
    return rest_;
}

std::string_view Words::next() {
    const std::string_view start = rest();
    std::size_t length = 0;
    while (length < start.size() && !parts(start[length])) ++length;
    rest_.remove_prefix(length);
    return start.substr(0, length);
}

bool Words::number(float& value) {
    std::string_view after = rest();
    if (!take_number(after, value) || (!after.empty() && !parts(after.front()))) return false;
    rest_ = after;
    return true;
}

bool Words::integer(std::int64_t& value) {
    std::string_view after = rest();
    if (!take_integer(after, value) || (!after.empty() && !parts(after.front()))) return false;
    rest_ = after;
    return true;
}

}  // namespace raydix
