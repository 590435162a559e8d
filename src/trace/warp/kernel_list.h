// Names of kernels -> their types.
#pragma once

#include <raydix/simulate.h>

#include "trace/warp/batches.h"
#include "trace/warp/packet.h"
#include "trace/warp/per_ray.h"
#include "trace/warp/replacement.h"
#include "trace/warp/restart_trail.h"
#include "trace/warp/wide.h"
#include "trace/warp/work_queue.h"

namespace raydix {

/// fn.template operator()<Kernel>()
template <class Fn>
auto with_kernel(WarpKernel kernel, const Fn& fn) {
    switch (kernel) {
        case WarpKernel::packet:
            return fn.template operator()<OneBatch<Packet>>();
        case WarpKernel::while_while:
            return fn.template operator()<OneBatch<WhileWhile>>();
        case WarpKernel::if_if:
            return fn.template operator()<OneBatch<IfIf>>();
        case WarpKernel::speculative_while_while:
            return fn.template operator()<OneBatch<SpeculativeWhileWhile>>();
        case WarpKernel::persistent_packet:
            return fn.template operator()<Persistent<Packet>>();
        case WarpKernel::persistent_while_while:
            return fn.template operator()<Persistent<WhileWhile>>();
        case WarpKernel::persistent_if_if:
            return fn.template operator()<Persistent<IfIf>>();
        case WarpKernel::persistent_speculative_while_while:
            return fn.template operator()<Persistent<SpeculativeWhileWhile>>();
        case WarpKernel::ray_replacement:
            return fn.template operator()<RayReplacement>();
        case WarpKernel::work_queue:
            return fn.template operator()<WorkQueue>();
        case WarpKernel::dynamic_fetch:
            return fn.template operator()<DynamicFetch>();
        case WarpKernel::cwbvh:
            return fn.template operator()<OneBatch<WideWhileWhile>>();
        case WarpKernel::short_stack:
            return fn.template operator()<OneBatch<ShortStack>>();
        case WarpKernel::persistent_cwbvh:
            return fn.template operator()<Persistent<WideWhileWhile>>();
        default:
            return fn.template operator()<Persistent<ShortStack>>();
    }
}

}  // namespace raydix
