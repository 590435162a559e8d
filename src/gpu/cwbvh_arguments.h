// What a kernel of compressed wide trees is given where it has one argument.
#pragma once

#include <raydix/device_cwbvh.h>

#include <cstdint>

#include "trace/cwbvh_threads.h"

namespace raydix {

template <class Store>
struct CwbvhArguments {
    kernels::CwbvhRays<Store> rays;
    std::uint32_t* next;  // of a pool: rays handed out
};

}  // namespace raydix
