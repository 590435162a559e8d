// What raydix/device_cwbvh.h does on the host: copies, sizes, what a launch refuses.
#include "gpu/device_cwbvh.h"

#include <raydix/error.h>

#include <string>

#include "base/options.h"
#include "layout/cwbvh.h"

namespace raydix {

static_assert(sizeof(CwbvhNode) % 16 == 0, "triangles behind the nodes are aligned");

DeviceCwbvh::DeviceCwbvh(const Cwbvh& tree, Stream stream) {
    const Cwbvh::Arrays& arrays = tree.arrays();
    const std::size_t node_bytes = arrays.stats.node_bytes;
    memory_.reset(node_bytes + arrays.stats.triangle_bytes);
    detail::copy_to_device(memory_.data(), arrays.nodes.data(), node_bytes, stream);
    detail::copy_to_device(memory_.data() + node_bytes, arrays.triangles.data(),
                           arrays.stats.triangle_bytes, stream);
    synchronize(stream);
    tree_.nodes = reinterpret_cast<const CwbvhNode*>(memory_.data());
    tree_.triangles = reinterpret_cast<const CwbvhTriangle*>(memory_.data() + node_bytes);
    tree_.node_count = static_cast<std::uint32_t>(arrays.nodes.size());
    tree_.max_depth = arrays.stats.max_depth;
    tree_.bounds = arrays.bounds;
}

DeviceCwbvhTree DeviceCwbvh::tree() const { return tree_; }

std::size_t device_cwbvh_scratch_bytes(CwbvhKernel kernel) {
    check_enum("kernel", kernel, CwbvhKernel::persistent_cwbvh);
    return kernel == CwbvhKernel::persistent_cwbvh ? 256 : 0;
}

void check_cwbvh_launch(const DeviceBackend::CwbvhCall& call) {
    const auto aligned = [](const void* at, std::uintptr_t to) {
        return reinterpret_cast<std::uintptr_t>(at) % to == 0;
    };
    check_enum("kernel", call.kernel, CwbvhKernel::persistent_cwbvh);
    if (call.count >= 1u << 31) throw InputError("2^31 rays or more in one launch");
    if (call.tree.max_depth > device_cwbvh_max_depth)
        throw InputError("the wide tree is " + std::to_string(call.tree.max_depth) +
                         " levels deep; the kernels' stacks hold " +
                         std::to_string(device_cwbvh_max_depth));
    if (!aligned(call.tree.nodes, 16) || !aligned(call.tree.triangles, 16))
        throw InputError("the wide tree on the device is not aligned to 16 bytes");
    if (!aligned(call.rays, 16) || !aligned(call.hits, 16))
        throw InputError("rays and hits on the device are not aligned to 16 bytes");
    const std::size_t wanted = device_cwbvh_scratch_bytes(call.kernel);
    if (call.scratch.size() < wanted)
        throw InputError("the launch wants " + std::to_string(wanted) +
                         " bytes of scratch on the device; it was given " +
                         std::to_string(call.scratch.size()));
    if (wanted != 0 && !aligned(call.scratch.data(), 256))
        throw InputError("the scratch on the device is not aligned to 256 bytes");
}

}  // namespace raydix
