// The kernels on simulated warps, behind plain functions: one table per kernel, kind of ray, width
// and instruction set.
#pragma once

#include <raydix/simulate.h>

#include <cstddef>
#include <cstdint>

#include "simt/simulated_warp.h"
#include "trace/warp/batches.h"
#include "trace/warp/lane.h"

namespace raydix {

/// What a simulated warp is given.
struct WarpSetup {
    OpCounts* tally;
    MemoryObserver* observer;  // or null
    std::uint32_t stack_entries;
};

/// A kernel's own state, the same in all lanes: a few words.
struct alignas(8) KernelState {
    std::byte bytes[32];
};

struct SimulatedKernel {
    bool persistent;     // warps fetch from the pool; else warp k has batch k
    bool keeps_rays;     // lanes are in use from one turn to the next
    bool local_stacks;   // lanes pop from stacks in memory, each from its own
    bool stacks_travel;  // with their rays, from lane to lane
    /// Memory of one warp, lanes and stacks, aligned to 64.
    std::size_t (*warp_bytes)(std::uint32_t stack_entries);
    void (*start_warp)(std::byte* warp, const WarpSetup& setup);
    void (*start_kernel)(KernelState& state);
    /// One turn; false when the warp is done.
    bool (*turn)(std::byte* warp, KernelState& state, const WarpJob& job, std::uint32_t warp_index);
    /// Instead of a turn, where persistent warps have a batch a turn: which one is next. False when
    /// the warp is done. Null for other kernels.
    bool (*next_batch)(std::byte* warp, KernelState& state, const WarpJob& job,
                       std::uint32_t& batch);
};

/// Null for a width that is not 1, 2, 4, 8, 16, 32, 64 or 128. Takes the fastest code that the
/// processor can run; all versions give the same bits.
[[nodiscard]] const SimulatedKernel* simulated_kernel(WarpKernel kernel, bool any_hit, int width);

/// Rays `begin` to `end` of the job by while_while, each by itself: the reference. `stack`:
/// [max_depth + 1].
using TraceOneByOne = void(const WarpJob& job, std::size_t begin, std::size_t end,
                           std::int32_t* stack);
[[nodiscard]] TraceOneByOne* one_by_one(bool any_hit);

/// The versions by name, for tests: `base` runs everywhere, `v3` needs AVX2 and FMA. Null where the
/// build or the processor lacks it.
enum class SimulatorIsa { base, v3 };
[[nodiscard]] const SimulatedKernel* simulated_kernel(WarpKernel kernel, bool any_hit, int width,
                                                      SimulatorIsa isa);

}  // namespace raydix
