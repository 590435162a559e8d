#include "measure/launch_model.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <random>

#include "exec/host_launcher.h"

namespace raydix {
namespace {

/// The least of several runs: what disturbs a loop only adds.
template <class Body>
double least_ms(int runs, const Body& body) {
    double least = std::numeric_limits<double>::infinity();
    for (int k = 0; k < runs; ++k) {
        std::vector<LaunchRecord> log;
        HostLauncher<> launcher(&log);
        body(launcher);
        double ms = 0;
        for (const LaunchRecord& record : log) ms += record.ms;
        least = std::min(least, ms);
    }
    return least;
}

struct Nothing {
    void operator()(std::uint32_t) const {}
};

struct Hop {
    const std::uint32_t* next;
    std::uint32_t hops;
    std::uint32_t* out;
    void operator()(std::uint32_t i) const {
        std::uint32_t at = i;
        for (std::uint32_t k = 0; k < hops; ++k) at = next[at];
        out[i] = at;
    }
};

/// A permutation that is one cycle, so that hops never come back early.
std::vector<std::uint32_t> one_cycle(std::uint32_t n) {
    std::vector<std::uint32_t> order(n), next(n);
    std::iota(order.begin(), order.end(), 0u);
    std::shuffle(order.begin(), order.end(), std::mt19937(7));
    for (std::uint32_t k = 0; k < n; ++k) next[order[k]] = order[(k + 1) % n];
    return next;
}

/// Elements of arrays that no cache holds. Sanitizers look at what the code does, not at its rates.
#if defined(RAYDIX_SANITIZED)
constexpr std::uint32_t past_caches = 1u << 18;
#else
constexpr std::uint32_t past_caches = 1u << 24;
#endif

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

double predicted_launch_ms(const LaunchFigures& launch, const LaunchMachine& machine,
                           double factor) {
    const double lanes = machine.lanes * factor;
    const double work_ns =
        (double(launch.items) * machine.item_ns + double(launch.steps) * machine.step_ns) / lanes;
    const double bytes_ns = double(launch.bytes) / (machine.bytes_per_ns * factor);
    const double chain_ns = launch.longest_chain * machine.latency_ns;
    return machine.launch_us * 1e-3 + std::max({work_ns, bytes_ns, chain_ns}) * 1e-6;
}

}  // namespace

double empty_launch_us() {
    constexpr int launches = 200;
    return 1e3 / launches * least_ms(5, [&](HostLauncher<>& launcher) {
               for (int k = 0; k < launches; ++k) launcher.launch("empty", 1, Nothing{});
           });
}

double memory_latency_ns() {
    constexpr std::uint32_t hops = 1u << 16;
    const std::vector<std::uint32_t> next = one_cycle(past_caches);
    std::uint32_t out = 0;
    return least_ms(5,
                    [&](HostLauncher<>& launcher) {
                        launcher.launch("hop", 1, Hop{next.data(), hops, &out});
                    }) *
           1e6 / hops;
}

double KernelCost::at(double keys) const {
    if (points.empty()) return unknown;
    if (keys <= points.front().keys) return points.front().ns;
    if (keys >= points.back().keys) return points.back().ns;
    const auto above = std::ranges::lower_bound(points, keys, std::ranges::less(), &Point::keys);
    const Point &low = *(above - 1), &high = *above;
    const double part = std::log(keys / low.keys) / std::log(high.keys / low.keys);
    return low.ns + part * (high.ns - low.ns);
}

const KernelCost* MeasuredCosts::find(const std::string& kernel) const {
    const auto found = std::ranges::find(kernels, kernel, &KernelCost::kernel);
    return found == kernels.end() ? nullptr : &*found;
}

double predicted_ms(const HierarchyRun& run, const LaunchFigures& launch,
                    const MeasuredCosts& costs, double factor) {
    const KernelCost* kernel = costs.find(kernel_of(run, launch));
    if (kernel == nullptr) return launch.items == 0 ? costs.launch_us * 1e-3 : unknown;
    const double work_ns = work_of(launch) * kernel->at(run.keys);
    // A part of this machine takes longer, however many items there are.
    const double shared_ns = work_ns / std::min(std::max(double(launch.items), 1.0), factor);
    // One thread has the chain in its work, most of it in a cache.
    const double chain_ns = std::min(work_ns, launch.longest_chain * costs.latency_ns);
    return costs.launch_us * 1e-3 + std::max(shared_ns, chain_ns) * 1e-6;
}

double predicted_ms(const HierarchyRun& run, const MeasuredCosts& costs, double factor) {
    if (run.what.form == StudyForm::tuned && factor != 1) return unknown;
    double sum = 0;
    for (const LaunchFigures& launch : run.launches)
        sum += predicted_ms(run, launch, costs, factor);
    return sum;
}

double predicted_ms(const HierarchyRun& run, const LaunchMachine& machine, double factor) {
    if (run.what.form == StudyForm::tuned) return unknown;
    double sum = 0;
    for (const LaunchFigures& launch : run.launches)
        sum += predicted_launch_ms(launch, machine, factor);
    return sum;
}

double HierarchyRun::measured_ms() const {
    double sum = 0;
    for (const LaunchFigures& launch : launches) sum += launch.ms;
    return sum;
}

std::vector<LaunchMachine> study_machines() {
    // Instruction counts per item and step are estimates: an item computes an index, tests a bound
    // and writes (some 20 instructions), a step computes an address, loads, compares and branches
    // (some 12).
    constexpr double item_instructions = 20, step_instructions = 12;
    const auto machine = [&](const char* name, double cores, double clock_ghz, double gb_per_s,
                             double latency_ns, double launch_us, const char* origin) {
        return LaunchMachine{name,
                             cores,
                             item_instructions / clock_ghz,
                             step_instructions / clock_ghz,
                             gb_per_s,
                             latency_ns,
                             launch_us,
                             origin};
    };
    return {machine("gtx480", 480, 1.401, 177, 430, 5,
                    "cores, clock and bandwidth: Karras 2012; 600 clocks of memory latency, 5 us a "
                    "launch, 20 instructions an item and 12 a step: estimates"),
            machine("h200", 132 * 128, 1.98, 4800, 350, 2.5,
                    "cores, clock and bandwidth: data sheet; 700 clocks of memory latency, 2.5 us "
                    "a launch, 20 instructions an item and 12 a step: estimates")};
}

}  // namespace raydix
