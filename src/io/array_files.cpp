// Plain arrays to and from .npy files.
#include <raydix/arrays.h>

#include "scene/npy.h"

namespace raydix {

std::vector<float> load_array(const std::filesystem::path& file, std::size_t columns) {
    return load_npy(file, columns);
}

void save_array(const std::filesystem::path& file, std::span<const float> values,
                std::size_t columns) {
    save_npy(file, values, columns);
}
void save_array(const std::filesystem::path& file, std::span<const std::uint32_t> values,
                std::size_t columns) {
    save_npy(file, values, columns);
}
void save_array(const std::filesystem::path& file, std::span<const std::uint64_t> values,
                std::size_t columns) {
    save_npy(file, values, columns);
}

}  // namespace raydix
