// The kernels that stand for functors on an OpenCL device: those of src/gpu/kernels/*.inc, which
// the device's side compiles from the same lines.
#pragma once

#include "exec/arithmetic_check.h"
#include "exec/opencl_launcher.h"
#include "gpu/device_build.h"

#define RAYDIX_EACH(kernel_name, ...)                                           \
    template <>                                                          \
    struct EachKernel<__VA_ARGS__> {                                     \
        static constexpr KernelName name{RAYDIX_MODULE, "each_" #kernel_name}; \
    };
#define RAYDIX_COUNTED(kernel_name, ...)                                           \
    template <>                                                             \
    struct CountedKernel<__VA_ARGS__> {                                     \
        static constexpr KernelName name{RAYDIX_MODULE, "counted_" #kernel_name}; \
    };
#define RAYDIX_WARPS(kernel_name, ...)                                           \
    template <>                                                           \
    struct WarpsKernel<__VA_ARGS__> {                                     \
        static constexpr KernelName name{RAYDIX_MODULE, "warps_" #kernel_name}; \
    };
#define RAYDIX_TILES(kernel_name, ...)                                           \
    template <>                                                           \
    struct TilesKernel<__VA_ARGS__> {                                     \
        static constexpr KernelName name{RAYDIX_MODULE, "tiles_" #kernel_name}; \
    };

namespace raydix {

#define RAYDIX_MODULE "sort"
#include "gpu/kernels/sort.inc"
#undef RAYDIX_MODULE
#define RAYDIX_MODULE "build"
#include "gpu/kernels/build.inc"
#undef RAYDIX_MODULE

}  // namespace raydix

#undef RAYDIX_EACH
#undef RAYDIX_COUNTED
#undef RAYDIX_WARPS
#undef RAYDIX_TILES
