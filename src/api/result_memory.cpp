#include "api/result_memory.h"

#include <raydix/error.h>

#include <fstream>
#include <limits>

namespace raydix {

std::uint64_t available_memory() {
    std::ifstream file("/proc/meminfo");
    std::string name, unit;
    for (std::uint64_t kilobytes = 0; file >> name >> kilobytes; std::getline(file, unit))
        if (name == "MemAvailable:") return kilobytes * 1024;
    return std::numeric_limits<std::uint64_t>::max();
}

std::uint64_t memory_limit(std::uint64_t max_bytes) {
    return max_bytes != 0 ? max_bytes : available_memory();
}

void check_result_fits(const std::string& what, std::uint64_t count, std::uint64_t bytes_each,
                       std::uint64_t limit) {
    if (count <= limit / bytes_each) return;
    throw InputError(what + ": a result of " + std::to_string(count) + " times " +
                     std::to_string(bytes_each) + " bytes does not fit into the " +
                     std::to_string(limit) + " bytes that it may take");
}

}  // namespace raydix
