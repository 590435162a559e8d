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

void check_cwbvh_launch(const DeviceCwbvhTree& tree, std::uint32_t count, CwbvhKernel kernel,
                        std::span<std::byte> scratch) {
    check_enum("kernel", kernel, CwbvhKernel::persistent_cwbvh);
    if (count >= 1u << 31) throw InputError("2^31 rays or more in one launch");
    if (tree.max_depth > device_cwbvh_max_depth)
        throw InputError("the wide tree is " + std::to_string(tree.max_depth) +
                         " levels deep; the kernels' stacks hold " +
                         std::to_string(device_cwbvh_max_depth));
    const std::size_t wanted = device_cwbvh_scratch_bytes(kernel);
    if (scratch.size() < wanted)
        throw InputError("the launch wants " + std::to_string(wanted) +
                         " bytes of scratch on the device; it was given " +
                         std::to_string(scratch.size()));
    if (wanted != 0 && reinterpret_cast<std::uintptr_t>(scratch.data()) % 256 != 0)
        throw InputError("the scratch on the device is not aligned to 256 bytes");
}

}  // namespace raydix
