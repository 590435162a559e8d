// Asks the operating system and the processor what this machine is.
#include <raydix/machine.h>

#include <fstream>

#include "exec/parallel.h"

namespace raydix {
namespace {

std::string cpu_name() {
    std::ifstream file("/proc/cpuinfo");
    for (std::string line; std::getline(file, line);) {
        if (!line.starts_with("model name")) continue;
        const auto colon = line.find(": ");
        if (colon != std::string::npos) return line.substr(colon + 2);
    }
    return "unknown";
}

std::string vector_isa() {
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx512f")) return "avx512";
    if (__builtin_cpu_supports("avx2")) return "avx2";
    return "sse4.2";
#elif defined(__aarch64__)
    return "neon";
#else
    return "scalar";
#endif
}

}  // namespace

MachineInfo machine_info() { return {cpu_name(), thread_count(), vector_isa(), ""}; }

}  // namespace raydix
