// The machine that figures were measured on.
#pragma once

#include <string>

namespace raydix {

struct MachineInfo {
    std::string cpu;  // the processor's own name
    int cores = 0;    // that this process may use
    std::string isa;  // widest vector instructions: sse4.2, avx2, avx512, neon, ...
    std::string gpu;  // empty: none, or a build without CUDA
};

[[nodiscard]] MachineInfo machine_info();

}  // namespace raydix
