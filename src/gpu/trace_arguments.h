// What a traversal kernel is given where it has one argument.
#pragma once

#include <cstdint>

#include "trace/warp/batches.h"

namespace raydix {

struct TraceArguments {
    WarpJob job;
    std::uint32_t stack_entries;
    std::int32_t* stacks;  // of kernels whose lanes hand stacks to others
};

}  // namespace raydix
