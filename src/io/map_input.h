// A file of input as memory; what goes wrong is an InputError that names it.
#pragma once

#include <filesystem>

#include "exec/mapped_file.h"

namespace raydix {

[[nodiscard]] MappedFile mapped_input(const std::filesystem::path& file);

}  // namespace raydix
