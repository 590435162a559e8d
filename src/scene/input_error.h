// Error texts of the readers: "FILE: ELEMENT: reason", one line, whatever bytes the file or its
// name holds.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace raydix {

/// `bytes` as printable text: valid UTF-8 stays, control characters and all other bytes become
/// \xNN.
[[nodiscard]] std::string printable(std::string_view bytes);

/// The path as it is printed in messages.
[[nodiscard]] std::string printable(const std::filesystem::path& path);

/// A word of the input in quotes, escaped and cut to a readable length.
[[nodiscard]] std::string in_quotes(std::string_view word);

/// Throws InputError("file: element: reason"). `file` is printable already.
[[noreturn]] void input_error(std::string_view file, std::string_view element,
                              std::string_view reason);

}  // namespace raydix
