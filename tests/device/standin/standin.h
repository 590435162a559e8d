// What a test says to the stand-in for AMD's runtime (hip_runtime.cpp) and asks of it: C functions
// of the same library, found with dlsym.
#pragma once

#include <cstdint>

namespace raydix::standin {

struct Figures {
    std::uint64_t allocations, modules, streams;  // that live
    std::uint64_t launches, waits;                // so far; waits for streams
    std::uint64_t kernels_of_module;              // of the last one that was loaded, with a kernel
                                                  // of SPIR-V each
    std::uint64_t kernels_of_spirv;
};

}  // namespace raydix::standin

extern "C" {
/// The devices: names of architectures with spaces between; none if empty.
void standin_devices(const char* architectures);
/// The call of this name fails with this status, when it has been made `after` times from now on.
void standin_fail(const char* call, int status, int after);
/// All calls succeed again.
void standin_heal();
void standin_figures(raydix::standin::Figures* figures);
}
