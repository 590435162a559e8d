// How long a machine takes for a row of launches of which it is known what they do: launches ->
// milliseconds. The model of Karras 2012, section 5: a larger machine has more cores and more
// bandwidth, and no shorter wires.
#pragma once

#include <raydix/hierarchy_study.h>

#include <span>

namespace raydix {

/// One launch: latency + the longest of what its work, its bytes and its longest chain take.
/// `factor`: times the cores and the bandwidth of `machine`; latencies stay.
[[nodiscard]] double predicted_ms(const LaunchFigures& launch, const LaunchMachine& machine,
                                  double factor);

}  // namespace raydix
