// Which version of the simulated kernels runs: by width, and by what the processor can do.
#include "trace/warp/simulated_kernels.h"

namespace raydix {
namespace simulator_isa {
struct base;
struct v3;
}  // namespace simulator_isa

// Instantiated in simulated_kernels_N.cpp, which the build compiles once per instruction set.
template <class Isa, int Width>
const SimulatedKernel* simulated_kernel_of_width(WarpKernel kernel, bool any_hit);
template <class Isa>
TraceOneByOne* one_by_one_of(bool any_hit);

namespace {

template <class Isa>
const SimulatedKernel* kernel_of(WarpKernel kernel, bool any_hit, int width) {
    switch (width) {
        case 1:
            return simulated_kernel_of_width<Isa, 1>(kernel, any_hit);
        case 2:
            return simulated_kernel_of_width<Isa, 2>(kernel, any_hit);
        case 4:
            return simulated_kernel_of_width<Isa, 4>(kernel, any_hit);
        case 8:
            return simulated_kernel_of_width<Isa, 8>(kernel, any_hit);
        case 16:
            return simulated_kernel_of_width<Isa, 16>(kernel, any_hit);
        case 32:
            return simulated_kernel_of_width<Isa, 32>(kernel, any_hit);
        case 64:
            return simulated_kernel_of_width<Isa, 64>(kernel, any_hit);
        case 128:
            return simulated_kernel_of_width<Isa, 128>(kernel, any_hit);
        default:
            return nullptr;
    }
}

bool has_v3() {
#if defined(RAYDIX_SIMULATOR_V3)
    static const bool has = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
                            __builtin_cpu_supports("bmi2");
    return has;
#else
    return false;
#endif
}

}  // namespace

const SimulatedKernel* simulated_kernel(WarpKernel kernel, bool any_hit, int width,
                                        SimulatorIsa isa) {
    if (isa == SimulatorIsa::base) return kernel_of<simulator_isa::base>(kernel, any_hit, width);
#if defined(RAYDIX_SIMULATOR_V3)
    if (has_v3()) return kernel_of<simulator_isa::v3>(kernel, any_hit, width);
#endif
    return nullptr;
}

const SimulatedKernel* simulated_kernel(WarpKernel kernel, bool any_hit, int width) {
    return simulated_kernel(kernel, any_hit, width,
                            has_v3() ? SimulatorIsa::v3 : SimulatorIsa::base);
}

TraceOneByOne* one_by_one(bool any_hit) {
#if defined(RAYDIX_SIMULATOR_V3)
    if (has_v3()) return one_by_one_of<simulator_isa::v3>(any_hit);
#endif
    return one_by_one_of<simulator_isa::base>(any_hit);
}

}  // namespace raydix
