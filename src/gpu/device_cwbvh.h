// What a launch over a compressed wide tree refuses.
#pragma once

#include <raydix/device_cwbvh.h>

#include <cstddef>
#include <cstdint>
#include <span>

namespace raydix {

/// Throws InputError: an unknown kernel, too many rays, too deep a tree, too little scratch.
void check_cwbvh_launch(const DeviceCwbvhTree& tree, std::uint32_t count, CwbvhKernel kernel,
                        std::span<std::byte> scratch);

}  // namespace raydix
