// Paths that the system would not read as they are.
#pragma once

#include <raydix/error.h>

#include <filesystem>

#include "base/printable.h"

namespace raydix {

/// Throws InputError that names the path if it holds a NUL: the system would take what stands
/// before it for the whole.
inline void require_no_nul(const std::filesystem::path& path) {
    if (path.native().find('\0') != std::filesystem::path::string_type::npos)
        throw InputError(printable(path) + ": a path must not hold a NUL character");
}

}  // namespace raydix
