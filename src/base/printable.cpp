#include "base/printable.h"

#include <fmt/format.h>

namespace raydix {
namespace {

bool is_continuation(char c) { return (static_cast<unsigned char>(c) & 0xC0u) == 0x80u; }

/// Length of the valid multi-byte UTF-8 sequence at the start of `s`, 0 if there is none.
std::size_t multibyte_length(std::string_view s) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(s[i]); };
    std::size_t length = 0;
    if (byte(0) >= 0xC2 && byte(0) <= 0xDF) length = 2;
    if (byte(0) >= 0xE0 && byte(0) <= 0xEF) length = 3;
    if (byte(0) >= 0xF0 && byte(0) <= 0xF4) length = 4;
    if (length == 0 || s.size() < length) return 0;
    for (std::size_t i = 1; i < length; ++i)
        if (!is_continuation(s[i])) return 0;
    // C1 controls, overlong forms, surrogates and what lies beyond U+10FFFF
    if (byte(0) == 0xC2 && byte(1) < 0xA0) return 0;
    if ((byte(0) == 0xE0 && byte(1) < 0xA0) || (byte(0) == 0xED && byte(1) > 0x9F)) return 0;
    if ((byte(0) == 0xF0 && byte(1) < 0x90) || (byte(0) == 0xF4 && byte(1) > 0x8F)) return 0;
    return length;
}

}  // namespace

std::string printable(std::string_view bytes) {
    std::string text;
    while (!bytes.empty()) {
        const char c = bytes.front();
        const bool plain = c >= 0x20 && c < 0x7F;
        const std::size_t length = plain ? 1 : multibyte_length(bytes);
        if (length == 0) text += fmt::format("\\x{:02X}", static_cast<unsigned char>(c));
        text += bytes.substr(0, length);
        bytes.remove_prefix(length == 0 ? 1 : length);
    }
    return text;
}

std::string printable(const std::filesystem::path& path) {
    return printable(std::string_view(path.native()));
}

}  // namespace raydix
