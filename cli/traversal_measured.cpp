#include "traversal_measured.h"

#include <fmt/format.h>
#include <raydix/device_trace.h>
#include <raydix/error.h>

#include <algorithm>
#include <cctype>
#include <cstring>

namespace raydix::cli {
namespace {

constexpr int warm_ups = 2;

/// Rays and hits of one launch in device memory, kept from launch to launch.
struct DeviceLaunch {
    DeviceBuffer<Ray> rays;
    DeviceBuffer<TreeHit> hits;
    DeviceBuffer<std::byte> scratch;
    std::vector<TreeHit> found, expected;
};

void check_hits(const DeviceLaunch& launch, WarpKernel kernel, bool any_hit) {
    for (std::size_t i = 0; i < launch.found.size(); ++i) {
        const TreeHit &a = launch.found[i], &b = launch.expected[i];
        if (any_hit ? a.hit() != b.hit() : std::memcmp(&a, &b, sizeof(a)) != 0)
            throw InputError(
                fmt::format("{} on the device: the hit of ray {} is not the scalar "
                            "reference's",
                            warp_kernel_name(kernel), i));
    }
}

/// Adds the kernel's milliseconds to those of each repeat.
void time_launch(const DeviceWarpTree& tree, DeviceLaunch& launch, WarpKernel kernel, bool any_hit,
                 std::vector<double>& ms) {
    const DeviceTraceOptions options{.kernel = kernel, .any_hit = any_hit};
    const std::size_t n = launch.expected.size();
    launch.scratch.reset(device_trace_scratch_bytes(tree, static_cast<std::uint32_t>(n), options));
    for (int turn = -warm_ups; turn < std::ssize(ms); ++turn) {
        const DeviceTraceMs time =
            time_trace_on_device(tree, {launch.rays.data(), n}, {launch.hits.data(), n}, options,
                                 {launch.scratch.data(), launch.scratch.size()}, nullptr);
        if (turn >= 0) ms[static_cast<std::size_t>(turn)] += time.kernel;
        if (turn != -1) continue;
        launch.found.resize(n);
        launch.hits.download(launch.found);
        check_hits(launch, kernel, any_hit);
    }
}

std::string lower_case(std::string text) {
    for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return text;
}

const SimulationRow* simulated_row(const std::vector<SimulationRow>& rows, const Json& measured) {
    const std::string device = lower_case(measured["device"].get<std::string>());
    const auto row = std::ranges::find_if(rows, [&](const SimulationRow& r) {
        return device.find(lower_case(r.options.machine.name)) != std::string::npos &&
               warp_kernel_name(r.options.kernel) == measured["kernel"].get<std::string>() &&
               r.rays == measured["rays"].get<std::string>() &&
               r.builder == measured["builder"].get<std::string>() && r.options.width == 32;
    });
    return row == rows.end() ? nullptr : &*row;
}

/// The lower of the issue bound and, where it was asked for, the memory model's.
double limit_of(const SimulationRow& row) {
    const SimulatedRates rates = row.rates();
    return row.options.memory && row.whole_launches && rates.memory > 0
               ? std::min(rates.bound, rates.memory)
               : rates.bound;
}

void set_beside(Json& measured, const std::vector<SimulationRow>& rows) {
    const SimulationRow* row = simulated_row(rows, measured);
    const bool known = row != nullptr && row->rates().bound > 0;
    measured["machine"] = known ? Json(row->options.machine.name) : Json(nullptr);
    measured["mrays_per_s_bound"] = known ? Json(row->rates().bound) : Json(nullptr);
    measured["mrays_per_s_limit"] = known ? Json(limit_of(*row)) : Json(nullptr);
    measured["percent_of_simulated"] = nullptr;
    if (!known) return;
    const double rate = measured["mrays_per_s"]["median"].get<double>();
    measured["percent_of_simulated"] = 100 * rate / limit_of(*row);
}

}  // namespace

Json measure_kind(const std::string& scene, const std::string& builder, const WarpTree& tree,
                  const RayLaunches& launches, RayKind kind,
                  const std::vector<SimulationRow>& simulated, const MeasureOptions& options) {
    const bool any_hit = kind == RayKind::ao;
    const DeviceWarpTree on_device(tree);
    DeviceLaunch launch;
    std::vector<std::vector<double>> ms(
        options.kernels.size(), std::vector<double>(static_cast<std::size_t>(options.repeat), 0.0));
    std::uint64_t rays = 0, largest = 0;
    launches.for_each(kind, [&](const RayUnit& unit, double) {
        rays += unit.rays.size();
        largest = std::max<std::uint64_t>(largest, unit.rays.size());
        launch.expected.resize(unit.rays.size());
        trace_reference(tree, unit.rays, launch.expected, any_hit);
        launch.rays.upload(unit.rays);
        launch.hits.reset(unit.rays.size());
        for (std::size_t k = 0; k < options.kernels.size(); ++k)
            time_launch(on_device, launch, options.kernels[k], any_hit, ms[k]);
    });
    Json rows = Json::array();
    for (std::size_t k = 0; k < options.kernels.size() && rays > 0; ++k) {
        std::vector<double> rates;
        for (const double total : ms[k]) rates.push_back(1e-3 * static_cast<double>(rays) / total);
        rows.push_back({{"scene", scene},
                        {"kernel", warp_kernel_name(options.kernels[k])},
                        {"rays", ray_kind_name(kind)},
                        {"device", device_name()},
                        {"builder", builder},
                        {"count", rays},
                        {"largest_launch", largest},
                        {"repeat", options.repeat},
                        {"same_hits_as_reference", true},
                        {"mrays_per_s", spread_json(spread_of(rates))}});
        set_beside(rows.back(), simulated);
    }
    return rows;
}

void print_measured(const Json& measured) {
    if (measured.empty()) return;
    fmt::print("\nmeasured on {}\n{:<28} {:<36} {:<18} {:>9} {:>9} {:>9}\n",
               measured.front()["device"].get<std::string>(), "scene", "kernel", "rays", "Mrays/s",
               "simulated", "of it");
    bool above = false;
    for (const Json& row : measured) {
        const double rate = row["mrays_per_s"]["median"].get<double>();
        fmt::print("{:<28} {:<36} {:<18} {:>9.1f}", row["scene"].get<std::string>(),
                   row["kernel"].get<std::string>(), row["rays"].get<std::string>(), rate);
        if (row["percent_of_simulated"].is_null()) {
            fmt::print(" {:>9} {:>9}\n", "-", "-");
            continue;
        }
        const std::string part =
            fmt::format(" {:>9.1f} {:>8.1f}%", row["mrays_per_s_limit"].get<double>(),
                        row["percent_of_simulated"].get<double>());
        const bool is_above = rate > row["mrays_per_s_bound"].get<double>();
        fmt::print("{}\n", is_above ? warning(part + " above the bound") : part);
        above = above || is_above;
    }
    if (above)
        fmt::print("{}\n", warning("above the bound: a cost or figure of the simulated machine is "
                                   "wrong, or the device is another one"));
}

}  // namespace raydix::cli
