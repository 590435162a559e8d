// Runs a pipeline's launches (the interface is told in host_launcher.h) as kernels on an in-order
// queue of OpenCL or HIP. Nothing is allocated here and the host waits for nothing: scans and sorts
// (warp_scan.h, warp_sort.h) work in memory that the caller lent, whose size QueueSizer finds by
// going through the same launches without running any.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "base/probe.h"
#include "exec/arena.h"
#include "exec/host_launcher.h"
#include "exec/kernel_arguments.h"
#include "exec/kernel_device.h"
#include "exec/launch_sizer.h"
#include "exec/warp_sort.h"

namespace raydix {

// The kernel that stands for a functor, by kind of launch: gpu/kernel_names.h has one for each that
// was compiled. A launch of another does not compile.
template <class Work>
struct EachKernel;
template <class Work>
struct CountedKernel;
template <class Work>
struct WarpsKernel;
template <class Work>
struct TilesKernel;

class QueueSizer : public LaunchSizer {
public:
    void exclusive_scan(const char*, std::uint32_t*, std::uint32_t n, std::uint32_t*) {
        grow_for<ScanScratch<std::uint32_t>>(n);
    }
    void exclusive_scan_counted(const char*, std::uint32_t*, const std::uint32_t*,
                                std::uint32_t limit) {
        grow_for<ScanScratch<std::uint32_t>>(limit);
    }
    void exclusive_scan_wide(const char*, std::uint64_t*, std::uint32_t n) {
        grow_for<ScanScratch<std::uint64_t>>(n);
    }
    template <class Key>
    void sort_pairs(const char*, const SortArrays<Key>&, std::uint32_t limit, const std::uint32_t*,
                    int) {
        grow_for<SortScratch>(limit);
    }

private:
    template <class Scratch>
    void grow_for(std::uint32_t n) {
        Arena arena;
        static_cast<void>(Scratch(arena, n));
        grow(arena.bytes());
    }
};

class QueueLauncher {
public:
    using Probe = NoProbe;
    /// A slow warp holds up only one other.
    static constexpr std::size_t warp_group_threads = 64;
    /// Groups of a counted launch: enough for the largest machine.
    static constexpr std::size_t counted_groups = 132 * 16;

    /// `memory`: the device's, aligned to 256 bytes, QueueSizer::bytes() at least; in use until
    /// the queue has passed the last launch.
    QueueLauncher(KernelDevice& device, Stream queue, void* memory, std::size_t memory_bytes)
        : device_(device), queue_(queue), memory_(memory), memory_bytes_(memory_bytes) {}

    template <class Work>
    void launch(const char*, std::uint32_t n, const Work& work) {
        if (n == 0) return;
        put(EachKernel<Work>::name, groups_of(n, KernelDevice::group_threads),
            KernelDevice::group_threads, EachArguments<Work>{work, n});
    }

    template <class Work>
    void launch_counted(const char*, const std::uint32_t* count, std::uint32_t limit,
                        const Work& work) {
        if (limit == 0) return;
        put(CountedKernel<Work>::name,
            std::min(groups_of(limit, KernelDevice::group_threads), most_groups()),
            KernelDevice::group_threads, CountedArguments<Work>{work, count, limit});
    }

    template <class Work>
    void launch_warps(const char*, const std::uint32_t* count, std::uint32_t limit,
                      const Work& work) {
        if (limit == 0) return;
        put(WarpsKernel<Work>::name, groups_of(limit, warp_group_threads), warp_group_threads,
            CountedArguments<Work>{work, count, limit});
    }

    /// work(warp, t) for t in [0, n).
    template <class Work>
    void launch_tiles(const char*, std::uint32_t n, const Work& work) {
        if (n == 0) return;
        put(TilesKernel<Work>::name, groups_of(n, warp_group_threads / warp_lanes),
            warp_group_threads, EachArguments<Work>{work, n});
    }

    void exclusive_scan(const char* label, std::uint32_t* values, std::uint32_t n,
                        std::uint32_t* total) {
        scan(label, ScanJob<std::uint32_t>{values, {n, nullptr}, total});
    }
    void exclusive_scan_counted(const char* label, std::uint32_t* values,
                                const std::uint32_t* count, std::uint32_t limit) {
        scan(label, ScanJob<std::uint32_t>{values, {limit, count}, nullptr, true});
    }
    void exclusive_scan_wide(const char* label, std::uint64_t* values, std::uint32_t n) {
        scan(label, ScanJob<std::uint64_t>{values, {n, nullptr}});
    }

    template <class Key>
    void sort_pairs(const char* label, const SortArrays<Key>& arrays, std::uint32_t limit,
                    const std::uint32_t* count, int key_bits) {
        Arena arena(memory_, memory_bytes_);
        launch_sort(*this, label, arrays, ItemCount{limit, count}, key_bits,
                    SortScratch(arena, limit));
    }

    /// The host does not wait to look.
    [[nodiscard]] bool maybe_any(const std::uint32_t*) const { return true; }

    [[nodiscard]] KernelDevice& device() const { return device_; }
    [[nodiscard]] Stream queue() const { return queue_; }

private:
    [[nodiscard]] static std::size_t groups_of(std::uint32_t items, std::size_t each) {
        return (items + each - 1) / each;
    }
    [[nodiscard]] std::size_t most_groups() const { return device_.is_cpu() ? 64 : counted_groups; }
    template <class Arguments>
    void put(const KernelName& kernel, std::size_t groups, std::size_t threads,
             const Arguments& arguments) {
        device_.launch(queue_, kernel, groups, threads, &arguments, sizeof(arguments));
    }
    template <class T>
    void scan(const char* label, const ScanJob<T>& job) {
        Arena arena(memory_, memory_bytes_);
        launch_scan(*this, label, job, ScanScratch<T>(arena, job.items.limit));
    }

    KernelDevice& device_;
    Stream queue_;
    void* memory_;
    std::size_t memory_bytes_;
};

}  // namespace raydix
