// Which kernel is the fastest on which machine, as far as the simulator can tell.
#pragma once

#include <vector>

#include "output.h"
#include "simulation.h"

namespace raydix::cli {

/// A row for each scene, machine and kind of rays that two kernels or more have traced: {scene,
/// machine, rays, kernels}. Kernels have {kernel, mrays_per_s, limit, first_over_it, low, high,
/// behind, needs}, the highest of the tightest limits first. `low` to `high` is `first_over_it`
/// with its error (ratio_error.h). `behind`: whether all of it is above 1, so that the first one is
/// told from this one. All three are null for the first, and where `needs` says what a verdict
/// takes.
[[nodiscard]] Json traversal_ranking(const std::vector<SimulationRow>& rows);
void print_ranking(const Json& ranking);

}  // namespace raydix::cli
