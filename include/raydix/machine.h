// The machine that figures were measured on.
#pragma once

#include <string>

namespace raydix {

struct MachineInfo {
    std::string cpu;  // the processor's own name
    int cores = 0;    // that this process may use
    std::string isa;  // widest vector instructions: avx512, avx2, sse4.2, neon or scalar
    std::string gpu;  // empty from machine_info; for callers that measure on a device
};

/// Asks the system and the processor.
[[nodiscard]] MachineInfo machine_info();

}  // namespace raydix
