// A file's bytes as memory, read page by page when they are touched.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>

namespace raydix {

struct MappedFile {
    std::shared_ptr<void> owner;  // unmaps with its last copy
    std::span<const std::byte> bytes;
};

/// Maps a regular file for reading. Its later changes by others may or may not show, and if it is
/// cut short, touching what is gone ends the process: that is how mappings are. Throws
/// std::system_error, and InputError for a path with a NUL.
[[nodiscard]] MappedFile map_file(const std::filesystem::path& file);

}  // namespace raydix
