// JSON text of a file -> document, with errors that name the file.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "scene/byte_source.h"

namespace raydix {

/// Deeper documents are refused.
inline constexpr int deepest_json = 64;

/// The rest of the source, at most `limit` bytes.
[[nodiscard]] std::string read_rest(ByteSource& in, std::uint64_t limit);

/// Exactly `n` bytes; memory grows only as they arrive. Throws InputError that names `element`.
[[nodiscard]] std::string read_exactly(ByteSource& in, std::uint64_t n, std::string_view element);

/// Throws InputError with the byte where the text stops being JSON.
[[nodiscard]] nlohmann::json parse_json(const ByteSource& in, std::string_view text);

/// object[key] as an integer in [0, 2^53], nothing if it is absent. Throws InputError if it is
/// something else.
[[nodiscard]] std::optional<std::uint64_t> find_whole(const ByteSource& in,
                                                      const nlohmann::json& object, const char* key,
                                                      std::string_view element);

}  // namespace raydix
