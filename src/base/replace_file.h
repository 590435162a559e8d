// Whole files at once: a reader sees the old file or the new one, never half of either.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

namespace raydix {

/// Writes `bytes` to a new file beside `file` and renames it. If anything fails, `file` is as it
/// was, nothing is left beside it, and InputError names the file and the system's reason.
void replace_file(const std::filesystem::path& file, std::span<const std::byte> bytes);

/// The same for bytes that lie in several places.
void replace_file(const std::filesystem::path& file,
                  std::span<const std::span<const std::byte>> pieces);

}  // namespace raydix
