// What Aila and Laine 2009 say of their kernels, beside what the simulator finds.
#pragma once

#include <vector>

#include "output.h"
#include "simulation.h"

namespace raydix::cli {

/// A row for each claim and scene for which `rows` have what it takes: {claim, paper, found, scene,
/// holds}. A claimed gain holds if at least half of it is found.
[[nodiscard]] Json traversal_claims(const std::vector<SimulationRow>& rows);
void print_claims(const Json& claims);

}  // namespace raydix::cli
