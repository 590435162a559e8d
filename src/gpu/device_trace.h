// What stands behind DeviceWarpTree, and the layout of a launch's scratch.
#pragma once

#include <raydix/device_trace.h>
#include <raydix/error.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "base/options.h"
#include "exec/arena.h"
#include "gpu/device_fetch.h"
#include "gpu/trace_launches.h"
#include "layout/warp_tree.h"
#include "trace/warp/launch_warps.h"

namespace raydix {

inline constexpr std::size_t warp_kernel_count = 15;

struct DeviceWarpTree::Arrays {
    DeviceBuffer<std::byte> own_pairs, own_triangles;  // the former if copied from the host
    DeviceBuffer<std::uint32_t> own_ids;
    WarpScene scene{nullptr, nullptr, nullptr};  // null: no triangles
    DeviceBuffer<std::byte> own_wide, own_wide_triangles;
    DeviceBuffer<std::uint32_t> own_wide_ids;
    std::uint32_t max_depth = 0, wide_max_depth = 0;
    // Blocks that fill the device, by kernel, closest and any hit: asked for once, not per launch.
    std::array<std::array<std::uint32_t, 2>, warp_kernel_count> resident_blocks{};

    [[nodiscard]] WarpLaunch launch(WarpKernel kernel, bool any_hit) const {
        check_enum("kernel", kernel, WarpKernel::persistent_short_stack);
        return {kernel, any_hit, warp_stack_entries(kernel, max_depth, wide_max_depth)};
    }
};

inline void check_stack_depth(std::uint32_t max_depth) {
    if (max_depth >= large_stack_entries)
        throw InputError("the tree is " + std::to_string(max_depth) +
                         " deep; the kernels on a device have stacks for depths up to " +
                         std::to_string(large_stack_entries - 1));
}

inline void check_wide(const DeviceWarpTree::Arrays& tree, const WarpLaunch& launch) {
    if (!reads_wide_nodes(launch.kernel) || tree.scene.pairs == nullptr) return;
    if (tree.scene.wide.nodes == nullptr)
        throw InputError(
            "the kernel " + std::string(warp_kernel_name(launch.kernel)) +
            " needs a WarpTree with wide nodes, copied from the host (DeviceCwbvh has kernels of "
            "its own)");
    if (launch.stack_entries > large_stack_entries)
        throw InputError("the wide tree is " + std::to_string(tree.wide_max_depth) +
                         " deep; the kernel " + std::string(warp_kernel_name(launch.kernel)) +
                         " has stacks for depths up to " +
                         std::to_string(large_stack_entries / 2 - 1));
}

/// What a launch works in.
struct DeviceTraceScratch {
    Ray* prepared = nullptr;
    std::uint32_t* next = nullptr;
    std::int32_t* stacks = nullptr;
    std::byte* launcher = nullptr;  // the launcher's own line

    DeviceTraceScratch() = default;
    DeviceTraceScratch(Arena& arena, std::uint32_t count, const WarpLaunch& launch,
                       std::uint32_t blocks)
        : prepared(arena.take<Ray>(count)),
          next(arena.take<std::uint32_t>(1)),
          stacks(arena.take<std::int32_t>(global_stack_entries(launch, blocks))),
          launcher(arena.take<std::byte>(Arena::alignment)) {}
};

/// Blocks of a launch: persistent kernels fill the device, or have a thread for each ray.
inline std::uint32_t blocks_of(const DeviceWarpTree::Arrays& tree, const WarpLaunch& launch,
                               std::uint32_t count) {
    const std::uint32_t all = (count + warp_block_threads - 1) / warp_block_threads;
    if (!is_persistent(launch.kernel)) return all;
    const std::uint32_t resident =
        tree.resident_blocks[static_cast<std::size_t>(launch.kernel)][launch.any_hit ? 1 : 0];
    return resident < all ? resident : all;
}

template <class T>
const T* upload_array(DeviceBuffer<std::byte>& to, const T* from, std::size_t count,
                      Stream stream) {
    to.upload({reinterpret_cast<const std::byte*>(from), count * sizeof(T)}, stream);
    return reinterpret_cast<const T*>(to.data());
}

/// A copy of a tree of the host. Waits for it.
inline std::unique_ptr<DeviceWarpTree::Arrays> upload_warp_tree(const WarpTree& tree,
                                                                Stream stream) {
    check_stack_depth(tree.max_depth());
    auto arrays = std::make_unique<DeviceWarpTree::Arrays>();
    const WarpTree::Arrays& from = tree.arrays();
    arrays->max_depth = from.max_depth;
    arrays->wide_max_depth = from.wide.max_depth;
    if (tree.empty()) return arrays;
    arrays->own_ids.upload({from.ids.data(), from.ids.size()}, stream);
    arrays->scene = {
        upload_array(arrays->own_pairs, from.pairs.data(), from.pairs.size(), stream),
        upload_array(arrays->own_triangles, from.triangles.data(), from.triangles.size(), stream),
        arrays->own_ids.data()};
    if (!tree.has_wide_nodes()) return arrays;
    const WarpTree::Arrays::Wide& wide = from.wide;
    arrays->own_wide_ids.upload({wide.ids.data(), wide.ids.size()}, stream);
    arrays->scene.wide = {
        upload_array(arrays->own_wide, wide.nodes.data(), wide.nodes.size(), stream),
        upload_array(arrays->own_wide_triangles, wide.triangles.data(), wide.triangles.size(),
                     stream),
        arrays->own_wide_ids.data(), wide.bounds, wide.padding};
    return arrays;
}

/// A tree that was built on the device, in the kernels' form. Waits for its counts and for the
/// triangles: rays may come on another stream.
template <class Launcher>
std::unique_ptr<DeviceWarpTree::Arrays> take_warp_tree(Launcher& launcher, const DeviceTree& tree,
                                                       Stream stream) {
    if (tree.pairs == nullptr || tree.pair_ids == nullptr)
        throw InputError("the tree on the device was built without node pairs");
    if (tree.triangles == nullptr) throw InputError("the tree on the device is not of triangles");
    const DeviceCounts counts = fetch_counts(tree.counts, stream);
    check_counts(counts, PrimitiveKind::triangles, false);
    check_stack_depth(counts.max_depth);
    auto arrays = std::make_unique<DeviceWarpTree::Arrays>();
    arrays->max_depth = counts.max_depth;
    const std::uint32_t n = counts.references;
    if (n == 0) return arrays;
    arrays->own_triangles.reset(n * sizeof(WoopTriangle));
    auto* maps = reinterpret_cast<WoopTriangle*>(arrays->own_triangles.data());
    launcher.launch("layout.woop", n, EmitWoopTriangle{tree.triangles, maps});
    synchronize(stream);
    arrays->scene = {tree.pairs, maps, tree.pair_ids};
    return arrays;
}

inline void check_trace_memory(std::span<const Ray> rays, std::span<TreeHit> hits,
                               std::span<std::byte> scratch, std::size_t needed) {
    const auto aligned = [](const void* at, std::uintptr_t to) {
        return reinterpret_cast<std::uintptr_t>(at) % to == 0;
    };
    if (rays.size() != hits.size())
        throw InputError(std::to_string(rays.size()) + " rays, but room for " +
                         std::to_string(hits.size()) + " hits");
    if (!aligned(rays.data(), 16) || !aligned(hits.data(), 16))
        throw InputError("rays and hits on the device are not aligned to 16 bytes");
    if (scratch.size() < needed)
        throw InputError("the launch wants " + std::to_string(needed) +
                         " bytes of scratch on the device; it was given " +
                         std::to_string(scratch.size()));
    if (!aligned(scratch.data(), Arena::alignment))
        throw InputError("the scratch on the device is not aligned to 256 bytes");
}

/// One launch of rays, checked: prepared, traced and scaled back.
class WarpTraceCall {
public:
    WarpTraceCall(const DeviceWarpTree& tree, std::span<const Ray> rays, std::span<TreeHit> hits,
                  const DeviceTraceOptions& options, std::span<std::byte> scratch)
        : tree_(tree),
          rays_(rays),
          hits_(hits),
          invalid_rays_(options.invalid_rays),
          count_(checked_count(rays)),
          launch_(tree.arrays().launch(options.kernel, options.any_hit)),
          blocks_(blocks_of(tree.arrays(), launch_, count_)) {
        check_wide(tree.arrays(), launch_);
        check_trail_levels(launch_.kernel, tree.arrays().max_depth);
        check_trace_memory(rays, hits, scratch, device_trace_scratch_bytes(tree, count_, options));
        arena_ = Arena(scratch.data(), scratch.size());
        work_ = DeviceTraceScratch(arena_, count_, launch_, blocks_);
    }
    [[nodiscard]] const DeviceTraceScratch& work() const { return work_; }

    /// `trace(launch, job, stacks, blocks)` puts the traversal kernel on the launcher's stream;
    /// `mark(k)` is called before (0) and behind (1) it.
    template <class Launcher, class Trace, class Mark>
    void launch(Launcher& launcher, const Trace& trace, const Mark& mark) const {
        launcher.launch("trace.prepare", count_,
                        PrepareRay{rays_.data(), work_.prepared, invalid_rays_});
        launcher.launch("trace.start", 1, StartPool{work_.next});
        mark(0);
        if (tree_.empty())
            launcher.launch("trace.miss", count_, MissAll{hits_.data()});
        else if (count_ != 0)
            trace(launch_,
                  WarpJob{tree_.arrays().scene, {work_.prepared, hits_.data(), count_, work_.next}},
                  work_.stacks, blocks_);
        mark(1);
        if (!tree_.empty())
            launcher.launch("trace.rescale", count_, RescaleHit{rays_.data(), hits_.data()});
    }

private:
    static std::uint32_t checked_count(std::span<const Ray> rays) {
        if (rays.size() >= 0x7FFFFFFFu) throw InputError("2^31 rays or more in one launch");
        return static_cast<std::uint32_t>(rays.size());
    }

    const DeviceWarpTree& tree_;
    std::span<const Ray> rays_;
    std::span<TreeHit> hits_;
    std::uint32_t* invalid_rays_;
    std::uint32_t count_;
    WarpLaunch launch_;
    std::uint32_t blocks_;
    Arena arena_;
    DeviceTraceScratch work_;
};

}  // namespace raydix
