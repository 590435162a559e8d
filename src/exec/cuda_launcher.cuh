// Runs a builder's launches (the interface is told in host_launcher.h) as kernels on a CUDA stream.
// Nothing is allocated here and the host waits for nothing: scans and sorts work in memory that the
// caller lent, whose size CudaSizer finds by going through the same launches without running any.
#pragma once

#include <cuda_runtime.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>
#if __has_include(<nvtx3/nvToolsExt.h>)
#include <nvtx3/nvToolsExt.h>
#define RAYDIX_HAVE_NVTX 1
#endif

#include "base/probe.h"
#include "exec/cuda_error.cuh"
#include "exec/host_launcher.h"
#include "exec/launch_sizer.h"
#include "exec/warp.h"

namespace raydix {

/// A named range in a profiler's time line for as long as it lives.
class ProfilerRange {
public:
#if defined(RAYDIX_HAVE_NVTX)
    explicit ProfilerRange(const char* label) { nvtxRangePushA(label); }
    ~ProfilerRange() { nvtxRangePop(); }
#else
    explicit ProfilerRange(const char*) {}
#endif
    ProfilerRange(const ProfilerRange&) = delete;
    ProfilerRange& operator=(const ProfilerRange&) = delete;
};

namespace kernels {

template <class Work>
__global__ void for_each(Work work, std::uint32_t n) {
    const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i < n) work(i);
}

/// The count is the device's own; a grid that fills the machine strides over it.
template <class Work>
__global__ void for_each_counted(Work work, const std::uint32_t* count, std::uint32_t limit) {
    const std::uint32_t n = *count < limit ? *count : limit;
    const std::uint32_t stride = gridDim.x * blockDim.x;
    // 64 bits: the last step may go past 2^32.
    for (std::uint64_t i = blockIdx.x * blockDim.x + threadIdx.x; i < n; i += stride)
        work(static_cast<std::uint32_t>(i));
}

inline constexpr unsigned warp_block_threads = 64;  // a slow warp holds up only one other
/// One warp for each w; blocks are whole warps. Room is asked for 24 blocks a multiprocessor: such
/// work waits for memory most of the time.
template <class Work>
__global__ void __launch_bounds__(warp_block_threads, 24)
    for_each_warp(Work work, const std::uint32_t* count) {
    const std::uint32_t w = (blockIdx.x * warp_block_threads + threadIdx.x) / warp_lanes;
    if (w < warps_for(*count)) work(DeviceWarp(), w);
}

/// One warp for each t of [0, n).
template <class Work>
__global__ void for_each_tile(Work work, std::uint32_t n) {
    const std::uint32_t t = (blockIdx.x * blockDim.x + threadIdx.x) / warp_lanes;
    if (t < n) work(DeviceWarp(), t);
}

}  // namespace kernels

/// The highest key behind the pairs that count: there the sort leaves what it finds.
template <class Key>
struct FillUnusedKeys {
    Key* keys;
    const std::uint32_t* count;
    RAYDIX_HD void operator()(std::uint32_t i) const {
        if (i >= *count) keys[i] = std::numeric_limits<Key>::max();
    }
};

struct ClearUnusedValues {
    std::uint32_t* values;
    const std::uint32_t* count;
    RAYDIX_HD void operator()(std::uint32_t i) const {
        if (i >= *count) values[i] = 0;
    }
};

struct SaveLastValue {
    const std::uint32_t* values;
    std::uint32_t n;
    std::uint32_t* saved;
    RAYDIX_HD void operator()(std::uint32_t) const { *saved = values[n - 1]; }
};

/// The sum of all values: the sum of those before the last, and the last.
struct AddLastValue {
    const std::uint32_t* scanned;
    std::uint32_t n;
    const std::uint32_t* saved;
    std::uint32_t* total;
    RAYDIX_HD void operator()(std::uint32_t) const { *total = scanned[n - 1] + *saved; }
};

struct SetWord {
    std::uint32_t* word;
    std::uint32_t value;
    RAYDIX_HD void operator()(std::uint32_t) const { *word = value; }
};

/// Bytes that CUB wants for a scan or a sort of so many.
template <class Value = std::uint32_t>
std::size_t cub_scan_bytes(std::uint32_t n) {
    std::size_t bytes = 0;
    Value* values = nullptr;
    RAYDIX_CUDA_TRY(cub::DeviceScan::ExclusiveSum(nullptr, bytes, values, values, n));
    return bytes;
}
template <class Key>
std::size_t cub_sort_bytes(std::uint32_t limit, int key_bits) {
    std::size_t bytes = 0;
    Key* keys = nullptr;
    std::uint32_t* values = nullptr;
    RAYDIX_CUDA_TRY(cub::DeviceRadixSort::SortPairs(nullptr, bytes, keys, keys, values, values,
                                                    limit, 0, key_bits));
    return bytes;
}

class CudaSizer : public LaunchSizer {
public:
    void exclusive_scan(const char*, std::uint32_t*, std::uint32_t n, std::uint32_t*) {
        if (n != 0) grow(cub_scan_bytes(n));
    }
    void exclusive_scan_counted(const char*, std::uint32_t*, const std::uint32_t*,
                                std::uint32_t limit) {
        grow(cub_scan_bytes(limit + 1));
    }
    void exclusive_scan_wide(const char*, std::uint64_t*, std::uint32_t n) {
        if (n != 0) grow(cub_scan_bytes<std::uint64_t>(n));
    }
    template <class Key>
    void sort_pairs(const char*, const SortArrays<Key>&, std::uint32_t limit, const std::uint32_t*,
                    int key_bits) {
        if (limit != 0) grow(cub_sort_bytes<Key>(limit, key_bits));
    }
};

class CudaLauncher {
public:
    using Probe = NoProbe;
    static constexpr unsigned block_threads = 128;
    /// Blocks of a counted launch: some for each multiprocessor of the largest machine there is.
    static constexpr unsigned counted_blocks = 132 * 16;
    /// Kept at the front of the lent memory for the last value of a scan.
    static constexpr std::size_t reserved_bytes = 256;

    /// `memory`: on the device, aligned to 256 bytes, reserved_bytes + CudaSizer::bytes() at least;
    /// in use until the stream has passed the last launch.
    CudaLauncher(cudaStream_t stream, void* memory, std::size_t memory_bytes)
        : stream_(stream),
          saved_(static_cast<std::uint32_t*>(memory)),
          memory_(static_cast<std::byte*>(memory) + reserved_bytes),
          memory_bytes_(memory_bytes - reserved_bytes) {}

    template <class Work>
    void launch(const char* label, std::uint32_t n, const Work& work) {
        if (n == 0) return;
        const ProfilerRange range(label);
        const unsigned blocks = (n - 1) / block_threads + 1;
        kernels::for_each<<<blocks, block_threads, 0, stream_>>>(work, n);
        RAYDIX_CUDA_TRY(cudaGetLastError());
    }

    template <class Work>
    void launch_counted(const char* label, const std::uint32_t* count, std::uint32_t limit,
                        const Work& work) {
        if (limit == 0) return;
        const ProfilerRange range(label);
        const unsigned blocks = std::min((limit - 1) / block_threads + 1, counted_blocks);
        kernels::for_each_counted<<<blocks, block_threads, 0, stream_>>>(work, count, limit);
        RAYDIX_CUDA_TRY(cudaGetLastError());
    }

    template <class Work>
    void launch_warps(const char* label, const std::uint32_t* count, std::uint32_t limit,
                      const Work& work) {
        if (limit == 0) return;
        const ProfilerRange range(label);
        const unsigned blocks = (limit - 1) / kernels::warp_block_threads + 1;
        kernels::for_each_warp<<<blocks, kernels::warp_block_threads, 0, stream_>>>(work, count);
        RAYDIX_CUDA_TRY(cudaGetLastError());
    }

    template <class Work>
    void launch_tiles(const char* label, std::uint32_t n, const Work& work) {
        if (n == 0) return;
        const ProfilerRange range(label);
        const unsigned blocks = (n - 1) / (block_threads / warp_lanes) + 1;
        kernels::for_each_tile<<<blocks, block_threads, 0, stream_>>>(work, n);
        RAYDIX_CUDA_TRY(cudaGetLastError());
    }

    void exclusive_scan(const char* label, std::uint32_t* values, std::uint32_t n,
                        std::uint32_t* total) {
        if (n == 0) {
            if (total != nullptr) launch(label, 1, SetWord{total, 0});
            return;
        }
        if (total != nullptr) launch(label, 1, SaveLastValue{values, n, saved_});
        {
            const ProfilerRange range(label);
            std::size_t bytes = memory_bytes_;
            RAYDIX_CUDA_TRY(
                cub::DeviceScan::ExclusiveSum(memory_, bytes, values, values, n, stream_));
        }
        if (total != nullptr) launch(label, 1, AddLastValue{values, n, saved_, total});
    }

    /// Scans the whole capacity, cleared behind the values that count: then the place behind them
    /// holds their sum.
    void exclusive_scan_counted(const char* label, std::uint32_t* values,
                                const std::uint32_t* count, std::uint32_t limit) {
        launch(label, limit + 1, ClearUnusedValues{values, count});
        exclusive_scan(label, values, limit + 1, nullptr);
    }

    void exclusive_scan_wide(const char* label, std::uint64_t* values, std::uint32_t n) {
        if (n == 0) return;
        const ProfilerRange range(label);
        std::size_t bytes = memory_bytes_;
        RAYDIX_CUDA_TRY(cub::DeviceScan::ExclusiveSum(memory_, bytes, values, values, n, stream_));
    }

    template <class Key>
    void sort_pairs(const char* label, const SortArrays<Key>& a, std::uint32_t limit,
                    const std::uint32_t* count, int key_bits) {
        if (limit == 0) return;
        if (count != nullptr) launch(label, limit, FillUnusedKeys<Key>{a.keys, count});
        const ProfilerRange range(label);
        std::size_t bytes = memory_bytes_;
        RAYDIX_CUDA_TRY(cub::DeviceRadixSort::SortPairs(memory_, bytes, a.keys, a.sorted_keys,
                                                        a.values, a.sorted_values, limit, 0,
                                                        key_bits, stream_));
    }

    /// The host does not wait to look.
    [[nodiscard]] bool maybe_any(const std::uint32_t*) const { return true; }

    [[nodiscard]] cudaStream_t stream() const { return stream_; }

private:
    cudaStream_t stream_;
    std::uint32_t* saved_;
    std::byte* memory_;
    std::size_t memory_bytes_;
};

}  // namespace raydix
