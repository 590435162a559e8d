// What raydix/device_trace.h does on the host.
#include "gpu/device_trace.h"

namespace raydix {

DeviceWarpTree::~DeviceWarpTree() = default;
DeviceWarpTree::DeviceWarpTree(DeviceWarpTree&&) noexcept = default;
DeviceWarpTree& DeviceWarpTree::operator=(DeviceWarpTree&&) noexcept = default;

bool DeviceWarpTree::empty() const { return arrays_->scene.pairs == nullptr; }
std::uint32_t DeviceWarpTree::max_depth() const { return arrays_->max_depth; }
std::uint64_t DeviceWarpTree::bytes() const {
    return arrays_->own_pairs.bytes() + arrays_->own_triangles.bytes() + arrays_->own_ids.bytes() +
           arrays_->own_wide.bytes() + arrays_->own_wide_triangles.bytes() +
           arrays_->own_wide_ids.bytes();
}

std::size_t device_trace_scratch_bytes(const DeviceWarpTree& tree, std::uint32_t count,
                                       const DeviceTraceOptions& options) {
    if (count >= 0x7FFFFFFFu) throw InputError("2^31 rays or more in one launch");
    const WarpLaunch launch = tree.arrays().launch(options.kernel, options.any_hit);
    Arena arena;
    static_cast<void>(
        DeviceTraceScratch(arena, count, launch, blocks_of(tree.arrays(), launch, count)));
    return arena.bytes();
}

}  // namespace raydix
