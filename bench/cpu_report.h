// Figures of `bench cpu` -> JSON, tables, ratios of the two sides, and what they are over scenes.
#pragma once

#include <vector>

#include "cli/output.h"
#include "cpu_builds.h"
#include "cpu_rates.h"

namespace raydix::bench {

struct SceneFigures {
    std::string scene;
    std::uint64_t triangles = 0;
    int threads = 0;  // the number that is compared; others are for the speed-up
    std::vector<PeerName> peers;
    std::vector<PeerBuilds> builds;
    std::vector<KindRates> kinds;
};

/// Ours over one of Embree's trees, or over the best of all of them ("best").
struct Ratio {
    std::string ours, embree;
    std::string figure;  // fresh_ms, kept_ms, bytes, primary_batch, primary_single, ao_batch, ...
    double value = 0;
};
[[nodiscard]] std::vector<Ratio> ratios_of(const SceneFigures& figures);

[[nodiscard]] cli::Json figures_json(const SceneFigures& figures);
void print_figures(const SceneFigures& figures);

/// Medians over the scenes, and the worst one.
[[nodiscard]] cli::Json summary_json(const std::vector<SceneFigures>& scenes);
void print_summary(const cli::Json& summary);

}  // namespace raydix::bench
