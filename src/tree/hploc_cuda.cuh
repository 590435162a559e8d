// H-PLOC as one launch on a GPU: the text of hploc.h with a warp of the device. lists, meeting,
// claimed and root as HplocArrays says; the caller owns all memory, and nothing waits for the
// device.
#pragma once

#include "tree/hploc.h"

namespace raydix {

/// Boxes of primitives in Morton order, as an array of structs.
struct DeviceBoxes {
    const Aabb* boxes;
    [[nodiscard]] RAYDIX_HD Aabb get(std::uint32_t place) const { return boxes[place]; }
};

/// What the pass needs before it starts. One thread per primitive.
template <class Key>
__global__ void prepare_hploc(HplocArrays<Key, DeviceBoxes> arrays) {
    const std::uint32_t k = blockIdx.x * blockDim.x + threadIdx.x;
    if (k >= arrays.keys.count) return;
    arrays.lists[k] = primitive_cluster | k;
    if (k + 1 < arrays.keys.count) arrays.meeting[k] = 0;
    if (k == 0) {
        *arrays.claimed = 0;
        *arrays.root = primitive_cluster;
    }
}

/// One warp per 32 primitives; whole warps only.
template <class Key>
__global__ void run_hploc(HplocArrays<Key, DeviceBoxes> arrays) {
    const std::uint32_t thread = blockIdx.x * blockDim.x + threadIdx.x;
    HplocWarp<CudaWarp, Key, DeviceBoxes>(arrays).run(thread / warp_lanes);
}

/// Both launches, on `stream`. keys.count >= 1.
template <class Key>
void launch_hploc(const HplocArrays<Key, DeviceBoxes>& arrays, cudaStream_t stream) {
    constexpr std::uint32_t block = 64;
    const std::uint32_t blocks = (arrays.keys.count + block - 1) / block;
    prepare_hploc<<<blocks, block, 0, stream>>>(arrays);
    run_hploc<<<blocks, block, 0, stream>>>(arrays);
}

}  // namespace raydix
