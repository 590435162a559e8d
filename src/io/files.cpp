#include <raydix/files.h>

#include "base/write_file.h"

namespace raydix {

void write_file(const std::filesystem::path& file, std::span<const std::byte> bytes) {
    write_pieces(file, std::span(&bytes, 1));
}

}  // namespace raydix
