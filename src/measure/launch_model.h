// How long a machine takes for a row of launches of which it is known what they do: launches ->
// milliseconds. The model of Karras 2012, section 5: a larger machine has more cores and more
// bandwidth, and no shorter wires.
#pragma once

#include <raydix/hierarchy_study.h>

#include <string>

namespace raydix {

/// What a launch is charged for: its items, and the steps of all of them.
[[nodiscard]] double work_of(const LaunchFigures& launch);
/// The name of its kernel in MeasuredCosts.
[[nodiscard]] std::string kernel_of(const HierarchyRun& run, const LaunchFigures& launch);

/// Of the calling context's threads, the least of several measurements.
[[nodiscard]] double empty_launch_us();
[[nodiscard]] double memory_latency_ns();

}  // namespace raydix
