// Figures of `bench cpu` -> tables.
#pragma once

#include <vector>

#include "cpu_ratios.h"

namespace raydix::bench {

/// Its name, and its builds if there are any.
void print_scene(const SceneFigures& figures);
void print_head_of_workloads(int rounds, const std::string& clock);
/// A line for each of our trees: our default call and our single calls beside Embree's best.
/// `all_modes`: then a line for each mode of both sides.
void print_workload(const SceneFigures& figures, const WorkloadFigures& workload, bool all_modes);
/// Nothing if only one number of threads was asked for.
void print_speed_ups(const SceneFigures& figures);
/// A table for each group of scenes and each of our trees.
void print_summary(const std::vector<SummaryRow>& rows);

}  // namespace raydix::bench
