// What one side of `bench cpu` is to the other: of a scene, over scenes, over groups of workloads.
#pragma once

#include <string>
#include <vector>

#include "cpu_figures.h"

namespace raydix::bench {

/// Ours over Embree's.
struct Ratio {
    std::string ours, embree;  // "balanced", "medium", "medium, high"
    std::string workload;      // empty for builds
    std::string figure;        // fresh_ms, kept_ms, bytes; batch, single, single_robust
    std::string best;          // the mode that stands for Embree: "high, 16-wide coherent"
    double value = 0;
};

/// Of rates. batch: our default call over the best of Embree's modes. single: our single calls over
/// its single calls. single_robust: over those of its ROBUST trees.
/// Embree's trees: LOW beside ours of quality fast, MEDIUM beside balanced, the better of MEDIUM
/// and HIGH beside high; all of them if none of these is there.
[[nodiscard]] std::vector<Ratio> workload_ratios(const SceneFigures& figures,
                                                 const WorkloadFigures& workload);
/// All of a scene: builds of each of our trees over each of Embree's, then the workloads.
[[nodiscard]] std::vector<Ratio> ratios_of(const SceneFigures& figures);

/// Of our trees over Embree's, of the number of threads that is compared. Null: there is none.
[[nodiscard]] const ModeFigures* default_mode(const SceneFigures& figures,
                                              const WorkloadFigures& workload,
                                              const std::string& ours, bool single);

/// How much faster than with one thread; the mode is the one that is best with all.
struct SpeedUp {
    std::string peer, workload, figure;  // kept_ms, batch, single
    double value = 0;
};
[[nodiscard]] std::vector<SpeedUp> speed_ups_of(const SceneFigures& figures);

/// Medians over the scenes of a group, and the worst one: of each figure; then over workloads of a
/// kind too, by the size of their batches.
struct SummaryRow {
    std::string group, ours, embree, workload, figure;
    double median = 0, worst = 0;
    std::string worst_scene, worst_workload;
    std::size_t scenes = 0;
};
[[nodiscard]] std::vector<SummaryRow> summary_of(const std::vector<SceneFigures>& scenes);
[[nodiscard]] cli::Json summary_json(const std::vector<SummaryRow>& rows);

}  // namespace raydix::bench
