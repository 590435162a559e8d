#include "trace/warp/residency.h"

#include <algorithm>
#include <cstdint>

#include "trace/warp/lane.h"

namespace raydix {
namespace {

/// Of a thread on sm_90, CUDA 13.0; tests/device/resources_test.py reads them from the assembler.
std::uint32_t registers_of(WarpKernel kernel) {
    switch (kernel) {
        case WarpKernel::packet:
        case WarpKernel::persistent_packet:
            return 45;
        case WarpKernel::work_queue:
            return 70;
        case WarpKernel::cwbvh:
        case WarpKernel::persistent_cwbvh:
            return 64;
        case WarpKernel::short_stack:
        case WarpKernel::persistent_short_stack:
            return 48;
        default:
            return 40;
    }
}

/// Of a lane: its spare ray and a place in the list of them. Stacks of packets, a few bytes a lane,
/// do not count.
std::uint32_t shared_bytes_of(WarpKernel kernel) {
    return kernel == WarpKernel::work_queue ? sizeof(Lane) + sizeof(std::uint32_t) : 0;
}

/// Registers are given out to warps by 256.
constexpr std::uint32_t register_unit = 8;

}  // namespace

MachineModel machine_for(const SimulateOptions& run) {
    MachineModel m = run.machine;
    const auto width = static_cast<std::uint32_t>(run.width);
    // Whole blocks or, where none fits, whole warps, one at least.
    const auto hold = [&](std::uint32_t lanes) {
        const std::uint32_t unit = lanes >= m.block_lanes ? m.block_lanes : width;
        m.resident_lanes = std::min(m.resident_lanes, std::max(lanes / unit * unit, width));
    };
    if (m.registers > 0)
        hold(m.registers /
             ((registers_of(run.kernel) + register_unit - 1) / register_unit * register_unit));
    const std::uint32_t shared = shared_bytes_of(run.kernel);
    if (m.shared_bytes > 0 && shared > 0) hold(m.shared_bytes / shared);
    m.block_lanes = std::min(m.block_lanes, m.resident_lanes);
    if (m.l1_shared_bytes > 0 && m.l1_bytes > 0) {
        const std::uint32_t taken = std::min(m.l1_shared_bytes, m.resident_lanes * shared);
        m.l1_bytes = std::clamp(m.l1_shared_bytes - taken, m.l1_line_bytes, m.l1_bytes);
    }
    return m;
}

}  // namespace raydix
