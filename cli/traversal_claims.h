// What Aila and Laine 2009 say of their kernels, beside what the simulator finds.
#pragma once

#include <vector>

#include "output.h"
#include "simulation.h"

namespace raydix::cli {

/// A row for each claim and scene whose kernels are in `rows`: {claim, paper, paper_low,
/// paper_high, published, found, ratio, low, high, scene, verdict, holds}. `low` and `high` are the
/// ratio with its error (ratio_error.h). The verdict is "holds" where all of low to high lies
/// within the paper's interval, "does not hold" where none of it does, and "open" between; holds is
/// true, false and null. Where there is no ratio, the verdict says what it takes.
[[nodiscard]] Json traversal_claims(const std::vector<SimulationRow>& rows);
void print_claims(const Json& claims);

}  // namespace raydix::cli
