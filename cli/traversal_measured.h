// The kernels of `raydix bench traversal` on a GPU: the same tree, cameras and launches as the
// simulator has, timed by the device.
#pragma once

#include <raydix/simulate.h>

#include <string>
#include <vector>

#include "output.h"
#include "ray_launches.h"
#include "simulation.h"

namespace raydix::cli {

struct MeasureOptions {
    std::vector<WarpKernel> kernels;
    int repeat = 10;  // timed launches behind two that warm up, as Aila and Laine have it
};

/// Rows of `measured`, one a kernel: rays of all launches over the kernel time of all. Every hit is
/// first compared with the scalar reference. A row is set beside the simulated one of the same
/// kernel, rays and tree on a machine whose name stands in the device's; without one there is no
/// bound to compare with. Throws BackendUnavailable, DeviceError, and InputError for other hits
/// than the reference's.
[[nodiscard]] Json measure_kind(const std::string& scene, const std::string& builder,
                                const WarpTree& tree, const RayLaunches& launches, RayKind kind,
                                const std::vector<SimulationRow>& simulated,
                                const MeasureOptions& options);
void print_measured(const Json& measured);

}  // namespace raydix::cli
