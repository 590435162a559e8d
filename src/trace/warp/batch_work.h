// What batches of rays make their warps issue. It is the same on every machine, so one run serves
// all of them, and kernels that differ in who takes which batch alone.
#pragma once

#include <raydix/simulate.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "exec/memory.h"
#include "simt/op.h"
#include "trace/warp/simulated_kernels.h"

namespace raydix {

/// How often each operation was issued.
using OpIssues = std::array<std::uint32_t, op_count>;

struct BatchWork {
    std::vector<OpIssues> batches;  // [rays / width, rounded up]
    OpCounts counts{};              // of all together
};

/// Lanes and stacks of a number of warps.
class WarpMemoryPool {
public:
    WarpMemoryPool(const SimulatedKernel& kernel, std::size_t warps, const WarpSetup& setup)
        : stride_(kernel.warp_bytes(setup.stack_entries)), memory_(stride_ * warps) {
        for (std::size_t k = 0; k < warps; ++k) kernel.start_warp(at(k), setup);
    }
    [[nodiscard]] std::uint64_t bytes() const { return memory_.size(); }
    [[nodiscard]] std::byte* at(std::size_t k) { return memory_.data() + k * stride_; }

private:
    std::size_t stride_;
    Buffer<std::byte> memory_;
};

/// The kernel that traces the same batches with one warp each: `kernel` itself, if it does. None
/// if lanes keep rays from one turn to the next: what they do then depends on when they fetch.
[[nodiscard]] std::optional<WarpKernel> batch_kernel(WarpKernel kernel);

/// Batch k is rays [k * width, (k + 1) * width) of the job, which get their hits. `kernel` has one
/// batch a warp.
[[nodiscard]] BatchWork trace_batches(const SimulatedKernel& kernel, const WarpJob& job, int width,
                                      std::uint32_t stack_entries);
/// The same one after the other, under the eyes of `observer`; done(k) follows batch k.
[[nodiscard]] BatchWork trace_batches_in_order(const SimulatedKernel& kernel, const WarpJob& job,
                                               int width, std::uint32_t stack_entries,
                                               MemoryObserver& observer,
                                               const std::function<void(std::size_t)>& done);

}  // namespace raydix
