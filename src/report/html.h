// Text -> HTML that shows exactly this text, whatever it holds; bytes -> data URIs.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace raydix::report {

/// For text and for attribute values in quotes. Bytes that are not UTF-8 and control characters
/// become U+FFFD.
[[nodiscard]] std::string escaped(std::string_view text);

/// The same, with places where a long name may be broken: after _ ? & = / + and commas.
[[nodiscard]] std::string breakable(std::string_view text);

/// Letters, digits and dashes only, for id attributes.
[[nodiscard]] std::string id_of(std::string_view text);

/// At most `longest` code points; what is cut is replaced by an ellipsis. `text` is plain.
[[nodiscard]] std::string shortened(std::string_view text, std::size_t longest);

/// RFC 4648, with padding.
[[nodiscard]] std::string base64(std::span<const std::byte> bytes);

}  // namespace raydix::report
