#include "scene/input_error.h"

#include <fmt/format.h>
#include <raydix/error.h>

namespace raydix {
namespace {

constexpr std::size_t longest_quote = 40;

}  // namespace

std::string readable(std::string_view word) {
    const bool cut = word.size() > longest_quote;
    return printable(word.substr(0, longest_quote)) + (cut ? "..." : "");
}

std::string in_quotes(std::string_view word) { return '"' + readable(word) + '"'; }

void input_error(std::string_view file, std::string_view element, std::string_view reason) {
    throw InputError(fmt::format("{}: {}: {}", file, element, reason));
}

}  // namespace raydix
