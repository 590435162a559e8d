// The kernels of Aila and Laine behind `raydix trace`: on a GPU, where they are timed, or on a
// simulated machine, which gives their hits and what it could reach.
#pragma once

#include <raydix/bvh.h>
#include <raydix/device_trace.h>
#include <raydix/simulate.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "output.h"

namespace raydix::cli {

/// What --kernel may be, on any device.
[[nodiscard]] std::vector<std::string> trace_kernel_names();
/// The kernel of `device` if none is named.
[[nodiscard]] std::string default_kernel(const std::string& device);
/// Throws CLI::ValidationError that names what goes together.
void check_kernel(const std::string& kernel, const std::string& device);

class WarpTracer {
public:
    struct Times {
        double kernel_s = 0;      // as Aila and Laine report
        double end_to_end_s = 0;  // from the caller's rays to the caller's hits
    };
    struct Settings {
        std::string device, kernel, machine;
        bool any_hit = false;
        int threads = 0;
    };
    /// Puts the tree on the device. Throws BackendUnavailable without one.
    WarpTracer(const Bvh& bvh, const Settings& settings);

    [[nodiscard]] bool is_simulated() const { return settings_.device == "sim"; }
    [[nodiscard]] const Settings& settings() const { return settings_; }
    /// Simulated rays have no times. `counted`: the figures of this run count.
    Times run(std::span<const Ray> rays, std::vector<Hit>& hits, bool counted);
    [[nodiscard]] std::uint64_t invalid_rays() const { return invalid_; }
    /// Of the simulated machine: its name and rates, all simulated.
    [[nodiscard]] Json simulated_json() const;

private:
    Times run_on_device(std::span<const Ray> rays, std::vector<Hit>& hits, bool counted);
    void run_simulated(std::span<const Ray> rays, std::vector<Hit>& hits);

    Settings settings_;
    WarpTree tree_;
    SimulateOptions simulate_;
    Simulation figures_;
    std::optional<DeviceWarpTree> device_tree_;
    DeviceBuffer<Ray> rays_;
    DeviceBuffer<TreeHit> hits_;
    std::vector<TreeHit> found_;
    DeviceBuffer<std::uint32_t> device_invalid_;
    DeviceBuffer<std::byte> scratch_;
    std::uint64_t invalid_ = 0;
};

/// Prints one of the document's traces: kernels of a GPU count no visits, simulated ones have
/// simulated rates.
void print_warp_trace(const Json& trace);

}  // namespace raydix::cli
