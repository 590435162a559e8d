// Bytes of files and file names -> text that is safe to print on one line.
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

}  // namespace raydix
