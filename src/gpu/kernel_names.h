// The kernels that stand for functors on devices of OpenCL and HIP: those of src/gpu/kernels/*.inc,
// which the device's side compiles from the same lines.
#pragma once

#include "engine/name_hit.h"
#include "exec/arithmetic_check.h"
#include "exec/queue_launcher.h"
#include "gpu/device_build.h"
#include "gpu/device_queries.h"
#include "gpu/device_trees.h"
#include "gpu/trace_launches.h"
#include "trace/warp/kernel_list.h"

#define RAYDIX_EACH(kernel_name, ...)                                          \
    template <>                                                                \
    struct EachKernel<__VA_ARGS__> {                                           \
        static constexpr KernelName name{RAYDIX_MODULE, "each_" #kernel_name}; \
    };
#define RAYDIX_COUNTED(kernel_name, ...)                                          \
    template <>                                                                   \
    struct CountedKernel<__VA_ARGS__> {                                           \
        static constexpr KernelName name{RAYDIX_MODULE, "counted_" #kernel_name}; \
    };
#define RAYDIX_WARPS(kernel_name, ...)                                          \
    template <>                                                                 \
    struct WarpsKernel<__VA_ARGS__> {                                           \
        static constexpr KernelName name{RAYDIX_MODULE, "warps_" #kernel_name}; \
    };
#define RAYDIX_TILES(kernel_name, ...)                                          \
    template <>                                                                 \
    struct TilesKernel<__VA_ARGS__> {                                           \
        static constexpr KernelName name{RAYDIX_MODULE, "tiles_" #kernel_name}; \
    };

#define RAYDIX_TRACE(kernel_name, ...)                                                        \
    template <>                                                                               \
    struct TraceKernel<__VA_ARGS__> {                                                         \
        static constexpr KernelName closest{RAYDIX_MODULE, "trace_" #kernel_name "_closest"}; \
        static constexpr KernelName any{RAYDIX_MODULE, "trace_" #kernel_name "_any"};         \
    };

namespace raydix {

/// The kernels of a traversal kernel of src/trace/warp.
template <class Kernel>
struct TraceKernel;

#define RAYDIX_MODULE "sort"
#include "gpu/kernels/sort.inc"
#undef RAYDIX_MODULE
#define RAYDIX_MODULE "sorted"
#include "gpu/kernels/sorted.inc"
#undef RAYDIX_MODULE
#define RAYDIX_MODULE "build"
#include "gpu/kernels/build.inc"
#undef RAYDIX_MODULE
#define RAYDIX_MODULE "hploc"
#include "gpu/kernels/hploc.inc"
#undef RAYDIX_MODULE
#define RAYDIX_MODULE "trees"
#include "gpu/kernels/trees.inc"
#undef RAYDIX_MODULE
#define RAYDIX_MODULE "queries"
#include "gpu/kernels/queries.inc"
#undef RAYDIX_MODULE
#define RAYDIX_MODULE "trace"
#include "gpu/kernels/trace.inc"
#include "gpu/kernels/trace_around.inc"
#undef RAYDIX_MODULE
#define RAYDIX_MODULE "trace_votes"
#include "gpu/kernels/trace_votes.inc"
#undef RAYDIX_MODULE

}  // namespace raydix

#undef RAYDIX_EACH
#undef RAYDIX_COUNTED
#undef RAYDIX_WARPS
#undef RAYDIX_TILES
#undef RAYDIX_TRACE
