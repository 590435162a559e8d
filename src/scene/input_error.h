// Error texts of the readers: "FILE: ELEMENT: reason", one line, whatever bytes the file or its
// name holds.
#pragma once

#include <string>
#include <string_view>

#include "base/printable.h"

namespace raydix {

/// A word of the input, escaped and cut to a readable length; the same in quotes.
[[nodiscard]] std::string readable(std::string_view word);
[[nodiscard]] std::string in_quotes(std::string_view word);

/// Throws InputError("file: element: reason"). `file` is printable already.
[[noreturn]] void input_error(std::string_view file, std::string_view element,
                              std::string_view reason);

}  // namespace raydix
