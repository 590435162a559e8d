// Writes whole files: the one way in which anything is saved.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

namespace raydix {

/// What write_file of <raydix/files.h> promises, for bytes that lie in several places.
void write_pieces(const std::filesystem::path& file,
                  std::span<const std::span<const std::byte>> pieces);

}  // namespace raydix
