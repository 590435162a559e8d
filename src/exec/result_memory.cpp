#include "exec/result_memory.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <string>

#if __has_include(<unistd.h>)
#include <unistd.h>
#endif

namespace raydix {
namespace {

namespace fs = std::filesystem;

/// The number behind `name` in a file of names and numbers; `missing` if it is not there.
std::uint64_t number_of(const fs::path& path, const std::string& name, std::uint64_t missing) {
    std::ifstream file(path);
    std::string word, rest;
    for (std::uint64_t number = 0; file >> word >> number; std::getline(file, rest))
        if (word == name) return number;
    return missing;
}

/// A file that holds one number; unknown_memory for "max", or without such a file.
std::uint64_t number_in(const fs::path& path) {
    std::ifstream file(path);
    std::uint64_t number = 0;
    return file >> number ? number : unknown_memory;
}

/// Names of files and of lines in a group's folder, by version.
struct GroupNames {
    const char *limit, *use, *active_files, *inactive_files;
};
constexpr GroupNames version_2{"memory.max", "memory.current", "active_file", "inactive_file"};
constexpr GroupNames version_1{"memory.limit_in_bytes", "memory.usage_in_bytes",
                               "total_active_file", "total_inactive_file"};

/// Caches of files are given back when memory is short: they are no use.
std::uint64_t left_in(const fs::path& folder, const GroupNames& names) {
    const std::uint64_t limit = number_in(folder / names.limit);
    if (limit == unknown_memory) return unknown_memory;
    const std::uint64_t use = number_in(folder / names.use);
    if (use == unknown_memory) return limit;
    const fs::path stat = folder / "memory.stat";
    const std::uint64_t files =
        number_of(stat, names.active_files, 0) + number_of(stat, names.inactive_files, 0);
    const std::uint64_t held = use - std::min(files, use);
    return limit - std::min(held, limit);
}

/// Of the group `path` and all above it. A container may see its own group as the root: then only
/// that folder is there.
std::uint64_t least_left(const fs::path& mount, std::string path, const GroupNames& names) {
    std::uint64_t least = unknown_memory;
    for (;;) {
        least = std::min(least, left_in(fs::path(mount.string() + path), names));
        if (path.empty()) return least;
        path.resize(path.rfind('/') == std::string::npos ? 0 : path.rfind('/'));
    }
}

/// Of the controllers ":cpu,memory:", whether memory is one.
bool lists_memory(const std::string& names) {
    const std::size_t at = names.find("memory");
    if (at == std::string::npos) return false;
    const auto ends = [&](std::size_t k) { return names[k] == ',' || names[k] == ':'; };
    return ends(at - 1) && ends(at + 6);
}

std::uint64_t physical_memory() {
#if defined(_SC_PHYS_PAGES) && defined(_SC_PAGESIZE)
    const long pages = sysconf(_SC_PHYS_PAGES), bytes = sysconf(_SC_PAGESIZE);
    if (pages > 0 && bytes > 0)
        return static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(bytes);
#endif
    return unknown_memory;
}

}  // namespace

std::uint64_t system_memory_left(const fs::path& meminfo) {
    const std::uint64_t kilobytes = number_of(meminfo, "MemAvailable:", unknown_memory);
    return kilobytes == unknown_memory ? unknown_memory : kilobytes * 1024;
}

std::uint64_t group_memory_left(const fs::path& cgroup, const fs::path& mount) {
    std::uint64_t least = unknown_memory;
    std::ifstream file(cgroup);
    for (std::string line; std::getline(file, line);) {  // "4:cpu,memory:/path" or "0::/path"
        const std::size_t first = line.find(':'), second = line.find(':', first + 1);
        if (first == std::string::npos || second == std::string::npos) continue;
        const std::string names = line.substr(first, second - first + 1);  // ":cpu,memory:"
        const std::string path = line.substr(second + 1);
        if (names == "::")
            least = std::min(least, least_left(mount, path, version_2));
        else if (lists_memory(names))
            least = std::min(least, least_left(mount / "memory", path, version_1));
    }
    return least;
}

std::uint64_t available_memory() {
    const std::uint64_t left = std::min(system_memory_left("/proc/meminfo"),
                                        group_memory_left("/proc/self/cgroup", "/sys/fs/cgroup"));
    return left == unknown_memory ? physical_memory() : left;
}

}  // namespace raydix
