// How many lanes of a kernel a multiprocessor holds at a time.
#pragma once

#include <raydix/simulate.h>

namespace raydix {

/// The machine as the run's kernel finds it: no more resident_lanes than its registers and the
/// bytes that blocks share allow, and the L1 that these bytes leave.
[[nodiscard]] MachineModel machine_for(const SimulateOptions& run);

}  // namespace raydix
