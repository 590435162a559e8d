#include "measure/launch_model.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <numeric>
#include <random>

#include "exec/host_launcher.h"
#include "exec/parallel.h"
#include "measure/stopwatch.h"

namespace raydix {
namespace {

/// The least of several runs: what disturbs a loop only adds.
template <class Body>
double least_ms(int runs, const Body& body) {
    double least = 0;
    for (int k = 0; k < runs; ++k) {
        Stopwatch watch;
        body();
        const double ms = watch.lap();
        if (k == 0 || ms < least) least = ms;
    }
    return least;
}

struct CopyItem {
    const std::uint32_t* from;
    std::uint32_t* to;
    void operator()(std::uint32_t i) const { to[i] = from[i] + 1; }
};

/// A binary search: steps that compute an address, load, compare and branch on what nobody can
/// foresee.
struct Search {
    static constexpr std::uint32_t steps = 15;
    const std::uint32_t* sorted;  // [2^steps], ascending
    const std::uint32_t* wanted;
    std::uint32_t* out;
    void operator()(std::uint32_t i) const {
        std::uint32_t low = 0;
        for (std::uint32_t half = 1u << (steps - 1); half > 0; half /= 2) {
            if (sorted[low + half] > wanted[i]) continue;
            low += half;
            out[i] = low;  // keeps the branch a branch
        }
    }
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

/// One load from memory that no cache holds.
double memory_latency_ns() {
    constexpr std::uint32_t hops = 1u << 16;
    const std::vector<std::uint32_t> next = one_cycle(past_caches);
    std::uint32_t out = 0;
    HostLauncher<> launcher;
    return least_ms(5,
                    [&] {
                        launcher.launch("hop", 1, Hop{next.data(), hops, &out});
                    }) *
           1e6 / hops;
}

/// One thread's time for a step of a search in a table that the second-level cache holds.
double search_step_ns() {
    constexpr std::uint32_t n = 1u << Search::steps, items = 1u << 16;
    std::vector<std::uint32_t> sorted(n), wanted(items), out(items);
    std::mt19937 random(7);
    for (std::uint32_t& v : sorted) v = static_cast<std::uint32_t>(random());
    for (std::uint32_t& v : wanted) v = static_cast<std::uint32_t>(random());
    std::ranges::sort(sorted);
    HostLauncher<> launcher;
    const double ms = least_ms(5, [&] {
        launcher.launch("search", items, Search{sorted.data(), wanted.data(), out.data()});
    });
    return ms * 1e6 * thread_count() / (double(items) * Search::steps);
}

/// Bytes per nanosecond of a[i] = b[i] + c[i] over arrays that no cache holds.
double triad_bytes_per_ns() {
    constexpr std::size_t n = past_caches;
    std::vector<float> a(n), b(n, 1.0f), c(n, 2.0f);
    const double ms = least_ms(5, [&] {
        for_each_range(n, std::size_t{1} << 16, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) a[i] = b[i] + c[i];
        });
    });
    return double(3 * n * sizeof(float)) / (ms * 1e6);
}

}  // namespace

double predicted_ms(const LaunchFigures& launch, const LaunchMachine& machine, double factor) {
    const double lanes = machine.lanes * factor;
    const double work_ns =
        (double(launch.items) * machine.item_ns + double(launch.steps) * machine.step_ns) / lanes;
    const double bytes_ns = double(launch.bytes) / (machine.bytes_per_ns * factor);
    const double chain_ns = launch.longest_chain * machine.latency_ns;
    return machine.launch_us * 1e-3 + std::max({work_ns, bytes_ns, chain_ns}) * 1e-6;
}

double predicted_ms(const HierarchyRun& run, const LaunchMachine& machine, double factor) {
    double sum = 0;
    for (const LaunchFigures& launch : run.launches) sum += predicted_ms(launch, machine, factor);
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
                    "launch, 20 "
                    "instructions an item and 12 a step: estimates"),
            machine("h200", 132 * 128, 1.98, 4800, 350, 2.5,
                    "cores, clock and bandwidth: data sheet; 700 clocks of memory latency, 2.5 us "
                    "a launch, 20 "
                    "instructions an item and 12 a step: estimates")};
}

LaunchMachine measure_this_machine(int threads) {
    LaunchMachine machine;
    with_threads(threads, [&] {
        machine.name = "this machine";
        machine.lanes = thread_count();
        HostLauncher<> launcher;
        std::vector<std::uint32_t> from(std::size_t{1} << 16), to(from.size());
        constexpr int empty_launches = 200;
        const auto small = static_cast<std::uint32_t>(2048 * thread_count());
        machine.launch_us =
            1e3 / empty_launches * least_ms(5, [&] {
                for (int k = 0; k < empty_launches; ++k)
                    launcher.launch("empty", small, CopyItem{from.data(), to.data()});
            });
        const auto n = static_cast<std::uint32_t>(from.size());
        const double copy_ms = least_ms(9, [&] {
            launcher.launch("copy", n, CopyItem{from.data(), to.data()});
        });
        machine.item_ns =
            std::max(0.05, (copy_ms * 1e6 - machine.launch_us * 1e3) * machine.lanes / n);
        machine.launch_us =
            std::max(0.0, machine.launch_us - small * machine.item_ns * 1e-3 / machine.lanes);
        machine.step_ns = search_step_ns();
        machine.latency_ns = memory_latency_ns();
        machine.bytes_per_ns = triad_bytes_per_ns();
        machine.origin =
            "measured: empty launches, a copy of 65,536 words, binary searches in 128 KB, a chain "
            "of "
            "loads in 64 MB, triad of 192 MB";
    });
    return machine;
}

}  // namespace raydix
