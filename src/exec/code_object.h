// The code objects that clang made of the kernels, one for each architecture of AMD's.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace raydix {

/// The ELF file for an architecture, such as gfx90a; empty if this build has none.
[[nodiscard]] std::span<const char> code_object(std::string_view architecture);

/// Those that this build has: "gfx90a, gfx1100".
[[nodiscard]] std::string code_object_names();

}  // namespace raydix
