// Kernels x kinds of rays x machines on simulated warps: figures, their table, their JSON.
#pragma once

#include <raydix/simulate.h>

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "output.h"
#include "ray_launches.h"

namespace raydix::cli {

class SimulationState;

/// What every launch of a kind takes by one cheap kernel: by it a sample of the launches is
/// corrected (ratio estimator: Cochran, Sampling Techniques, 1977, chapter 6).
struct LaunchTimes {
    WarpKernel kernel;
    std::vector<double> time = {}, rays = {};  // [launches], as sampled: microseconds a ray

    /// Rate over all launches, over the rate of the first `n`.
    [[nodiscard]] double correction(std::size_t n) const;
};

/// One kernel, kind and machine over all launches.
struct SimulationRow {
    std::string scene;
    RayKind kind;      // of `rays`
    std::string rays;  // name of the kind, or a file
    SimulateOptions options;
    Simulation sum;
    std::string builder = {};                          // of the tree
    Json asked = {};                                   // asked_rays_json, ao_radius, launch_rays
    double sample = 1.0;                               // as asked for
    double part_taken = 1.0;                           // of all rays
    bool whole_launches = true;                        // else there is no launch to schedule
    std::uint64_t different_hits = 0;                  // from those of the scalar reference
    std::uint64_t invalid_rays = 0;                    // of a file
    std::vector<SimulatedRates> units;                 // of each launch or run that was traced
    std::shared_ptr<const LaunchTimes> all = nullptr;  // of those that were not, too

    /// Of the sums, corrected for the launches that were not traced.
    [[nodiscard]] SimulatedRates rates() const;
    /// By which rates are corrected; 1 if all was traced, or nothing is known of the rest.
    [[nodiscard]] double correction() const;
    /// Caches and warps in flight have no meaning for a part of a launch.
    [[nodiscard]] bool has_memory() const { return options.memory && whole_launches; }
    /// The lowest of bound, schedule and memory limits, as far as they are known.
    [[nodiscard]] SimulatedRates::Limit tightest() const;
    /// Of bound, scheduled and memory the one that tightest() is.
    [[nodiscard]] double SimulatedRates::*tightest_rate() const;
    /// [units] by how much a unit's time is off what is known of it beforehand, as a part of the
    /// mean time. `rate`: the bound or another one.
    [[nodiscard]] std::vector<double> deviations(double SimulatedRates::*rate) const;
    /// Relative standard error that comes from tracing a part of the rays only: of the bound or of
    /// the schedule, whichever is larger, after the correction. 0 if all were traced; nothing if
    /// there is only one unit.
    [[nodiscard]] std::optional<double> sampling_error() const;
};

/// Relative standard error of the mean of `deviations`, of units that are `part` of all.
[[nodiscard]] double error_of_mean(std::span<const double> deviations, double part);

/// When to end before all launches are done, and how to go on then.
struct SimulationEnd {
    double error = -1;  // ends when no row's sampling error is larger; corrects for the rest
    SimulationState* state = nullptr;  // or null
};

/// Runs all `runs` over the launches of one kind; ao rays are any-hit rays.
[[nodiscard]] std::vector<SimulationRow> simulate_kind(const SceneTree& input, const WarpTree& tree,
                                                       const RayLaunches& launches, RayKind kind,
                                                       std::vector<SimulateOptions> runs,
                                                       const LaunchOptions& options,
                                                       const CommonOptions& common,
                                                       const SimulationEnd& end = {});

/// The same over given rays, as one launch.
[[nodiscard]] std::vector<SimulationRow> simulate_rays(const SceneTree& input, const WarpTree& tree,
                                                       std::span<const Ray> rays,
                                                       const std::string& name,
                                                       std::vector<SimulateOptions> runs,
                                                       const CommonOptions& common);

/// The simulator leaves these out without a word.
[[nodiscard]] std::uint64_t count_invalid_rays(std::span<const Ray> rays, int threads);

/// Of the rays of one kind: which they are.
[[nodiscard]] Json asked_launches_json(const SceneTree& input, const RayLaunches& launches,
                                       RayKind kind, const LaunchOptions& options);

[[nodiscard]] Json simulation_json(const SimulationRow& row);
[[nodiscard]] Json machine_model_json(const MachineModel& machine);
void print_simulation(const std::vector<SimulationRow>& rows);
/// Which part of the way from bound to scheduled is due to what, of rows over whole launches.
void print_steps_to_scheduled(const std::vector<SimulationRow>& rows);
/// A machine by name, or from a JSON file. Another name is a usage error.
[[nodiscard]] MachineModel machine_from(const std::string& name_or_file);
/// Before any work. Throws InputError if a run has a machine that cannot be; it names the file if
/// there is one.
void check_machine(const std::string& name_or_file, std::span<const SimulateOptions> runs);
/// Names separated by commas, or "all".
[[nodiscard]] std::vector<WarpKernel> kernels_from(const std::string& names);
/// With wide nodes if one of the kernels reads them.
[[nodiscard]] WarpTree warp_tree_for(const Bvh& bvh, const std::vector<WarpKernel>& kernels);
[[nodiscard]] std::vector<RayKind> kinds_from(const std::string& names);

}  // namespace raydix::cli
