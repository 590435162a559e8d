#include "report/html.h"

#include <array>
#include <cstdint>

namespace raydix::report {
namespace {

constexpr std::string_view replacement = "\xEF\xBF\xBD";  // U+FFFD

/// Bytes of the well-formed sequence at the start of `text`; 0 if there is none (Unicode, table
/// 3-7: no overlong forms, no surrogates, nothing past U+10FFFF).
std::size_t sequence_length(std::string_view text) {
    const auto byte = [&](std::size_t i) -> unsigned {
        return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u;
    };
    const auto trails = [&](std::size_t from, std::size_t to) {
        for (std::size_t i = from; i < to; ++i)
            if ((byte(i) & 0xC0u) != 0x80u) return false;
        return true;
    };
    const unsigned lead = byte(0), next = byte(1);
    if (lead < 0x80) return 1;
    if (lead >= 0xC2 && lead <= 0xDF) return trails(1, 2) ? 2 : 0;
    if (lead >= 0xE0 && lead <= 0xEF) {
        if ((lead == 0xE0 && next < 0xA0) || (lead == 0xED && next > 0x9F)) return 0;
        return trails(1, 3) ? 3 : 0;
    }
    if (lead >= 0xF0 && lead <= 0xF4) {
        if ((lead == 0xF0 && next < 0x90) || (lead == 0xF4 && next > 0x8F)) return 0;
        return trails(1, 4) ? 4 : 0;
    }
    return 0;
}

bool is_control(std::string_view sequence) {
    const auto c = static_cast<unsigned char>(sequence[0]);
    return sequence.size() == 1 && (c < 0x20 || c == 0x7F) && c != '\n' && c != '\t';
}

/// Calls `take(sequence)` for each code point of valid text, with U+FFFD for what is none.
template <class Take>
void for_each_code_point(std::string_view text, const Take& take) {
    while (!text.empty()) {
        const std::size_t length = sequence_length(text);
        const std::string_view sequence = length ? text.substr(0, length) : replacement;
        take(is_control(sequence) ? replacement : sequence);
        text.remove_prefix(length ? length : 1);
    }
}

void append_escaped(std::string& out, std::string_view sequence) {
    switch (sequence[0]) {
        case '&':
            out += "&amp;";
            break;
        case '<':
            out += "&lt;";
            break;
        case '>':
            out += "&gt;";
            break;
        case '"':
            out += "&quot;";
            break;
        case '\'':
            out += "&#39;";
            break;
        default:
            out += sequence;
    }
}

}  // namespace

std::string escaped(std::string_view text) {
    std::string out;
    out.reserve(text.size());
    for_each_code_point(text, [&](std::string_view sequence) { append_escaped(out, sequence); });
    return out;
}

std::string breakable(std::string_view text) {
    std::string out;
    for_each_code_point(text, [&](std::string_view sequence) {
        append_escaped(out, sequence);
        if (std::string_view("_?&=/+,").find(sequence) != std::string_view::npos) out += "<wbr>";
    });
    return out;
}

std::string id_of(std::string_view text) {
    std::string id;
    for (const char c : text) {
        const bool letter = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
        const bool upper = c >= 'A' && c <= 'Z';
        if (letter || upper)
            id += upper ? static_cast<char>(c - 'A' + 'a') : c;
        else if (!id.empty() && id.back() != '-')
            id += '-';
    }
    while (!id.empty() && id.back() == '-') id.pop_back();
    return id.empty() ? "x" : id;
}

std::string shortened(std::string_view text, std::size_t longest) {
    std::size_t count = 0, cut = 0, at = 0;
    std::string out;
    for_each_code_point(text, [&](std::string_view sequence) {
        ++count;
        out += sequence;
        at += sequence.size();
        if (count + 1 == longest) cut = at;
    });
    if (count <= longest) return out;
    return out.substr(0, cut) + "\xE2\x80\xA6";
}

std::string base64(std::span<const std::byte> bytes) {
    static constexpr std::string_view digits =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    out.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        const auto byte = [&](std::size_t k) {
            return k < bytes.size() ? static_cast<std::uint32_t>(bytes[k]) : 0u;
        };
        const std::uint32_t three = byte(i) << 16 | byte(i + 1) << 8 | byte(i + 2);
        const std::array<char, 4> four{digits[three >> 18], digits[three >> 12 & 63],
                                       i + 1 < bytes.size() ? digits[three >> 6 & 63] : '=',
                                       i + 2 < bytes.size() ? digits[three & 63] : '='};
        out.append(four.data(), four.size());
    }
    return out;
}

}  // namespace raydix::report
