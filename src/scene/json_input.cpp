// Whole reads and checked look-ups for the formats that are JSON.
#include "scene/json_input.h"

#include <fmt/format.h>

#include <algorithm>

namespace raydix {

using nlohmann::json;

namespace {

/// Appends up to `n` bytes, a block at a time, so that a false `n` costs nothing.
void append_bytes(ByteSource& in, std::uint64_t n, std::string& bytes) {
    while (n > 0 && in.fill(1)) {
        const auto step =
            static_cast<std::size_t>(std::min<std::uint64_t>(n, in.buffered().size()));
        bytes.append(in.buffered().substr(0, step));
        in.consume(step);
        n -= step;
    }
}

}  // namespace

std::string read_rest(ByteSource& in, std::uint64_t limit) {
    std::string bytes;
    append_bytes(in, limit, bytes);
    if (in.fill(1)) in.fail("file", fmt::format("longer than {} bytes", limit));
    return bytes;
}

std::string read_exactly(ByteSource& in, std::uint64_t n, std::string_view element) {
    std::string bytes;
    append_bytes(in, n, bytes);
    if (bytes.size() < n)
        in.fail(element, fmt::format("ends after {} of {} bytes", bytes.size(), n));
    return bytes;
}

json parse_json(const ByteSource& in, std::string_view text) {
    const auto limit_depth = [&](int depth, json::parse_event_t, json&) {
        if (depth > deepest_json)
            in.fail("JSON", fmt::format("nested deeper than {} levels", deepest_json));
        return true;
    };
    try {
        return json::parse(text.begin(), text.end(), limit_depth);
    } catch (const json::parse_error& error) {
        in.fail("JSON", fmt::format("not valid at byte {}", error.byte));
    } catch (const json::exception&) {
        in.fail("JSON", "a number is out of range");
    }
}

std::optional<std::uint64_t> find_whole(const ByteSource& in, const json& object, const char* key,
                                        std::string_view element) {
    constexpr std::uint64_t largest = std::uint64_t{1} << 53;
    const auto found = object.find(key);
    if (found == object.end()) return std::nullopt;
    if (!found->is_number_unsigned() || found->get<std::uint64_t>() > largest)
        in.fail(element, fmt::format("{} is not an integer from 0 to 2^53", key));
    return found->get<std::uint64_t>();
}

}  // namespace raydix
