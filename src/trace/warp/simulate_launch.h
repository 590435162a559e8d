// One launch of rays through one kernel on one simulated machine.
#pragma once

#include <raydix/simulate.h>

#include <cstdint>
#include <span>

#include "simt/memory_model.h"
#include "simt/op.h"
#include "trace/warp/batch_work.h"
#include "trace/warp/lane.h"

namespace raydix {

/// Of a machine's table: the kernel's own counts, and for the rest those of all kernels. Throws
/// InputError if an operation is missing, repeated or unknown, or a kernel is unknown.
[[nodiscard]] OpCosts op_costs(const MachineModel& machine, WarpKernel kernel);
/// Of these, the instructions that half of the lanes execute.
[[nodiscard]] OpCosts op_half_rates(const MachineModel& machine, WarpKernel kernel);

/// rays [n], prepared (prepare_rays.h), fewer than 2^31 -> hits [n]. `stack_entries`: at least the
/// tree's depth. `memory`: the scene's arrays, for the memory model. `batches`: what the rays make
/// warps issue, if the kernel has a batch_kernel and there is no memory model; hits are there then.
[[nodiscard]] Simulation simulate_launch(const WarpScene& scene, std::uint32_t stack_entries,
                                         std::span<const Ray> rays, std::span<TreeHit> hits,
                                         const SimulateOptions& options,
                                         std::span<const MemoryRange> memory,
                                         const BatchWork* batches = nullptr);

}  // namespace raydix
