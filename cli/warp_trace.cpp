// Rays of the caller -> device or simulator -> hits of the caller.
#include "warp_trace.h"

#include <fmt/format.h>
#include <raydix/trace.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>

#include "simulation.h"

namespace raydix::cli {
namespace {

std::string joined(const std::vector<std::string>& names) {
    std::string all;
    for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
    return all;
}

std::vector<std::string> warp_kernel_names() {
    std::vector<std::string> names;
    for (const WarpKernel kernel : warp_kernels()) names.emplace_back(warp_kernel_name(kernel));
    return names;
}

void set_hits(const std::vector<TreeHit>& found, std::vector<Hit>& hits) {
    std::ranges::transform(found, hits.begin(),
                           [](const TreeHit& hit) { return hit_of_tree(hit); });
}

}  // namespace

std::vector<std::string> trace_kernel_names() {
    std::vector<std::string> names{"engine", "scalar", "simd"};
    for (std::string& name : warp_kernel_names()) names.push_back(std::move(name));
    return names;
}

std::string default_kernel(const std::string& device) {
    return device == "cpu" ? "scalar" : "speculative_while_while";
}

void check_kernel(const std::string& kernel, const std::string& device) {
    const bool of_cpu = kernel == "scalar" || kernel == "engine";
    if (of_cpu == (device == "cpu")) return;
    throw CLI::ValidationError("--kernel",
                               kernel + " does not run on device " + device +
                                   "; cpu goes with engine and scalar, the others go with " +
                                   joined(warp_kernel_names()));
}

WarpTracer::WarpTracer(const Bvh& bvh, const Settings& settings)
    : settings_(settings), tree_(bvh, reads_wide_nodes(warp_kernel_from_name(settings.kernel))) {
    simulate_.kernel = warp_kernel_from_name(settings.kernel);
    simulate_.any_hit = settings.any_hit;
    if (is_simulated()) {
        simulate_.machine = machine_from(settings.machine);
        return;
    }
    device_tree_.emplace(tree_);
    device_invalid_.reset(1);
}

WarpTracer::Times WarpTracer::run(std::span<const Ray> rays, std::vector<Hit>& hits, bool counted) {
    hits.resize(rays.size());
    if (!is_simulated()) return run_on_device(rays, hits, counted);
    run_simulated(rays, hits);
    return {};
}

WarpTracer::Times WarpTracer::run_on_device(std::span<const Ray> rays, std::vector<Hit>& hits,
                                            bool counted) {
    DeviceTraceOptions options{.kernel = simulate_.kernel, .any_hit = settings_.any_hit};
    const std::uint32_t none = 0;
    if (counted) {
        options.invalid_rays = device_invalid_.data();
        device_invalid_.upload({&none, 1});
    }
    // Memory of a size that has been used before is kept, so that the clock sees no allocation.
    scratch_.reset(device_trace_scratch_bytes(*device_tree_,
                                              static_cast<std::uint32_t>(rays.size()), options));
    hits_.reset(rays.size());
    rays_.reset(rays.size());
    found_.resize(rays.size());
    const auto start = std::chrono::steady_clock::now();
    rays_.upload(rays);
    const DeviceTraceMs ms = time_trace_on_device(*device_tree_, {rays_.data(), rays.size()},
                                                  {hits_.data(), hits.size()}, options,
                                                  {scratch_.data(), scratch_.size()}, nullptr);
    hits_.download(found_);
    const std::chrono::duration<double> all = std::chrono::steady_clock::now() - start;
    set_hits(found_, hits);
    if (counted) {
        std::uint32_t invalid = 0;
        device_invalid_.download({&invalid, 1});
        invalid_ += invalid;
    }
    return {1e-3 * ms.kernel, all.count()};
}

void WarpTracer::run_simulated(std::span<const Ray> rays, std::vector<Hit>& hits) {
    std::vector<std::vector<TreeHit>> found;
    const std::vector<Simulation> figures =
        simulate(tree_, rays, {&simulate_, 1}, &found, settings_.threads);
    figures_.add(figures.front());
    set_hits(found.front(), hits);
    invalid_ += count_invalid_rays(rays, settings_.threads);
}

Json WarpTracer::simulated_json() const {
    const SimulatedRates rates = simulated_rates(figures_, simulate_);
    return {{"machine", simulate_.machine.name},
            {"mrays_per_s_bound", rates.bound},
            {"mrays_per_s_scheduled", rates.scheduled},
            {"simd_efficiency", rates.simd_efficiency}};
}

void print_warp_trace(const Json& trace) {
    const auto count = trace["count"].get<std::uint64_t>();
    const auto hits = trace["hits"].get<std::uint64_t>();
    fmt::print("\n{} rays, {} hits by {} on device {}\n", grouped(count), grouped(hits),
               trace["kernel"].get<std::string>(),
               trace.value("device_name", trace["device"].get<std::string>()));
    if (trace.contains("simulated")) {
        const Json& s = trace["simulated"];
        fmt::print(
            "the hits come from the simulator; *simulated* on {}: at most {:.1f} Mrays/s, {:.1f} "
            "with the distribution of work\n",
            s["machine"].get<std::string>(), s["mrays_per_s_bound"].get<double>(),
            s["mrays_per_s_scheduled"].get<double>());
    } else if (count != 0) {
        const Json &kernel = trace["mrays_per_s"], &all = trace["mrays_per_s_end_to_end"];
        fmt::print("{:.1f} Mrays/s in the kernel ({:.1f} to {:.1f}), {:.1f} from rays to hits\n",
                   kernel["median"].get<double>(), kernel["min"].get<double>(),
                   kernel["max"].get<double>(), all["median"].get<double>());
    }
    print_invalid_rays(trace["invalid_rays"].get<std::uint64_t>());
}

}  // namespace raydix::cli
