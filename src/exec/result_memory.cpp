#include "exec/result_memory.h"

#include <raydix/error.h>

#include <algorithm>
#include <fstream>
#include <limits>

namespace raydix {
namespace {

constexpr std::uint64_t no_limit = std::numeric_limits<std::uint64_t>::max();
constexpr std::uint64_t little = std::uint64_t{1} << 26;

/// The number behind `name` in a file of names and numbers; `missing` if it is not there.
std::uint64_t number_of(const char* path, const std::string& name, std::uint64_t missing) {
    std::ifstream file(path);
    std::string word, rest;
    for (std::uint64_t number = 0; file >> word >> number; std::getline(file, rest))
        if (word == name) return number;
    return missing;
}

std::uint64_t system_memory() {
    const std::uint64_t kilobytes = number_of("/proc/meminfo", "MemAvailable:", no_limit);
    return kilobytes == no_limit ? no_limit : kilobytes * 1024;
}

/// What the control group leaves beside the memory that is not just a cache of files.
std::uint64_t group_memory() {
    std::ifstream file("/sys/fs/cgroup/memory.max");
    std::uint64_t most = 0;
    if (!(file >> most)) return no_limit;  // "max", or no such file
    return most - std::min(number_of("/sys/fs/cgroup/memory.stat", "anon", 0), most);
}

}  // namespace

std::uint64_t available_memory() { return std::min(system_memory(), group_memory()); }

std::uint64_t memory_limit(std::uint64_t max_bytes, std::uint64_t most_bytes) {
    if (max_bytes != 0) return max_bytes;
    return most_bytes <= little ? no_limit : available_memory();
}

void check_result_fits(const std::string& what, std::uint64_t bytes, std::uint64_t limit) {
    if (bytes <= limit) return;
    throw InputError(what + ": a result of " + std::to_string(bytes) +
                     " bytes or more does not fit into the " + std::to_string(limit) +
                     " that it may take");
}

std::uint64_t saturating_product(std::uint64_t a, std::uint64_t b) {
    return b != 0 && a > no_limit / b ? no_limit : a * b;
}

}  // namespace raydix
