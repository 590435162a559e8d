#include "io/map_input.h"

#include <system_error>

#include "scene/input_error.h"

namespace raydix {

MappedFile mapped_input(const std::filesystem::path& file) {
    try {
        return map_file(file);
    } catch (const std::system_error& error) {
        input_error(printable(file), "file", error.what());
    }
}

}  // namespace raydix
