// Warps of a launch -> their instructions -> clocks on a machine. Batches that one warp traces
// from their start to their end are scheduled from what they issue (batch_work.h). Kernels whose
// lanes keep rays run in order of simulated time, because who fetches first decides who traces
// which ray.
#include "trace/warp/simulate_launch.h"

#include <raydix/error.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "simt/memory_model.h"
#include "simt/schedule.h"
#include "trace/warp/batch_work.h"
#include "trace/warp/simulated_kernels.h"

namespace raydix {
namespace {

std::size_t time_bin(std::uint64_t instructions) {
    if (instructions < 1) return 0;
    constexpr auto per_octave = static_cast<double>(Simulation::bins_per_octave);
    const double bin = per_octave * std::log2(static_cast<double>(instructions));
    return std::min(static_cast<std::size_t>(bin),
                    std::tuple_size_v<decltype(Simulation::warp_times)> - 1);
}

/// The launch as all parts below see it.
struct LaunchRun {
    const SimulateOptions& options;
    const SimulatedKernel& kernel;
    WarpJob job;
    std::uint32_t stack_entries;
    OpCosts costs;
    OpClocks clocks;
    std::unique_ptr<MemoryModel> memory;

    [[nodiscard]] std::uint32_t width() const { return static_cast<std::uint32_t>(options.width); }
    /// Warp instructions per clock of one multiprocessor.
    [[nodiscard]] double slots() const { return options.machine.lanes_per_clock / options.width; }
    /// What a warp does that issues operation k issues(k) times.
    template <class Issues>
    [[nodiscard]] WarpWork work_of(const Issues& issues) const {
        WarpWork work{};
        for (std::size_t k = 0; k < op_count; ++k) {
            const auto times = static_cast<double>(issues(k));
            work.instructions += times * costs[k];
            work.alone_clocks += times * clocks[k];
        }
        return work;
    }
};

void add_to_figures(Simulation& figures, const OpCounts& counts) {
    for (std::size_t k = 0; k < op_count; ++k) {
        OperationFigure& figure = figures.operations[k];
        figure.issues += counts[k].issues;
        figure.lanes += counts[k].lanes;
        figures.instructions += counts[k].issues * figure.instructions;
    }
}

/// The end of a launch: what was lost once nothing was left to hand out.
void add_times(Simulation& figures, const LaunchRun& run, double clocks, double last_handed_out,
               double work_after) {
    const double slots_per_clock = run.slots() * run.options.machine.multiprocessors;
    figures.scheduled_clocks += clocks;
    figures.issue_slots += clocks * slots_per_clock;
    figures.idle_issues += std::max(0.0, (clocks - last_handed_out) * slots_per_clock - work_after);
}

/// What each warp does, in the order of the launch.
std::vector<WarpWork> works_of(const LaunchRun& run, const BatchWork& batches,
                               Simulation& figures) {
    std::vector<WarpWork> works;
    works.reserve(batches.batches.size());
    for (const OpIssues& issues : batches.batches) {
        works.push_back(run.work_of([&](std::size_t k) { return issues[k]; }));
        ++figures.warp_times[time_bin(static_cast<std::uint64_t>(works.back().instructions))];
    }
    add_to_figures(figures, batches.counts);
    return works;
}

/// With the memory model: one cache, one order.
BatchWork watched_batches(const LaunchRun& run) {
    const MachineModel& m = run.options.machine;
    return trace_batches_in_order(
        run.kernel, run.job, run.options.width, run.stack_entries, *run.memory, [&](std::size_t w) {
            run.memory->hand_over(
                static_cast<std::uint32_t>(w * run.width() / m.block_lanes % m.multiprocessors));
        });
}

/// When the warps of a launch end.
struct LaunchTimes {
    double clocks = 0;           // of the whole launch
    double last_handed_out = 0;  // when its last block found a place
    double work_after = 0;       // instructions issued from then on
};

/// Blocks of `block_warps` warps go in order to places as they become free.
LaunchTimes schedule_blocks(const LaunchRun& run, const std::vector<WarpWork>& works,
                            std::size_t block_warps, BlockRelease release) {
    const MachineModel& m = run.options.machine;
    const std::size_t blocks = (works.size() + block_warps - 1) / block_warps;
    const auto block_lanes = static_cast<std::uint32_t>(block_warps) * run.width();
    BlockPlaces places(m.multiprocessors, std::max(1u, m.resident_lanes / block_lanes), blocks,
                       release);
    Multiprocessors machine(m.multiprocessors, run.slots());
    std::vector<std::uint32_t> left(blocks);
    LaunchTimes times;
    const auto start_blocks = [&] {
        for (BlockPlaces::Start start{}; places.take(start);) {
            const std::size_t end = std::min(works.size(), (start.block + 1) * block_warps);
            for (std::size_t w = start.block * block_warps; w < end; ++w, ++left[start.block])
                machine.add(start.place, static_cast<std::uint32_t>(w), works[w]);
            if (!places.all_taken()) continue;
            times.last_handed_out = machine.now();
            times.work_after = machine.work_left();
        }
    };
    start_blocks();
    while (!machine.idle()) {
        const std::size_t block = machine.next().warp / block_warps;
        if (--left[block] != 0) continue;
        places.finish(block);
        start_blocks();
    }
    times.clocks = machine.now();
    return times;
}

void add_batch_times(const LaunchRun& run, const std::vector<WarpWork>& works,
                     Simulation& figures) {
    const MachineModel& m = run.options.machine;
    const std::size_t block_warps = std::max(1u, m.block_lanes / run.width());
    const LaunchTimes times = schedule_blocks(run, works, block_warps, m.block_release);
    add_times(figures, run, times.clocks, times.last_handed_out, times.work_after);
    figures.single_warp_clocks += schedule_blocks(run, works, 1, BlockRelease::own).clocks;
    figures.free_block_clocks +=
        m.block_release == BlockRelease::own
            ? times.clocks
            : schedule_blocks(run, works, block_warps, BlockRelease::own).clocks;
}

/// Persistent warps, each turn at its time. `batches`: what they trace, if that is known; else they
/// trace it.
void run_persistent(const LaunchRun& run, const BatchWork* batches, Simulation& figures) {
    const MachineModel& m = run.options.machine;
    const std::uint32_t filling = std::max(1u, m.resident_lanes / run.width()) * m.multiprocessors;
    // No more warps than batches: those would only find the pool empty.
    const std::uint32_t batch_count = (run.job.launch.count - 1) / run.width() + 1;
    const std::uint32_t warps =
        std::clamp(static_cast<std::uint32_t>(std::ceil(filling * run.options.part_of_launch)), 1u,
                   batch_count);
    OpCounts tally{};
    WarpMemoryPool memory(run.kernel, run.kernel.keeps_rays ? warps : 1,
                          {&tally, run.memory.get(), run.stack_entries});
    if (run.memory && run.kernel.stacks_travel)
        run.memory->add_stacks(memory.at(0), memory.bytes());
    std::vector<KernelState> states(warps);
    std::vector<double> lives(warps);
    std::vector<bool> done(warps);
    Multiprocessors machine(m.multiprocessors, run.slots());
    const RayLaunch& launch = run.job.launch;
    double last = 0, left_at_last = 0, issued = 0, issued_at_last = 0;
    const auto turn = [&](std::uint32_t place, std::uint32_t warp) {
        const OpCounts before = tally;
        const bool more_rays = *launch.next < launch.count;
        const OpIssues* batch = nullptr;
        if (batches != nullptr) {
            std::uint32_t k = 0;
            done[warp] = !run.kernel.next_batch(memory.at(0), states[warp], run.job, k);
            if (!done[warp]) batch = &batches->batches[k];
        } else {
            done[warp] = !run.kernel.turn(memory.at(run.kernel.keeps_rays ? warp : 0), states[warp],
                                          run.job, warp);
        }
        if (run.memory) run.memory->hand_over(place);
        const WarpWork work = run.work_of([&](std::size_t k) {
            return tally[k].issues - before[k].issues + (batch != nullptr ? (*batch)[k] : 0u);
        });
        issued += work.instructions;
        lives[warp] += work.instructions;
        if (!run.kernel.keeps_rays && !done[warp])
            ++figures.warp_times[time_bin(static_cast<std::uint64_t>(work.instructions))];
        machine.add(place, warp, work);
        if (more_rays && *launch.next >= launch.count)
            last = machine.now(), left_at_last = machine.work_left(), issued_at_last = issued;
    };
    for (std::uint32_t w = 0; w < warps; ++w) {
        run.kernel.start_kernel(states[w]);
        turn(w % m.multiprocessors, w);
    }
    while (!machine.idle()) {
        const Multiprocessors::Finished at = machine.next();
        if (!done[at.warp]) turn(at.place, at.warp);
    }
    if (run.kernel.keeps_rays)
        for (const double life : lives)
            ++figures.warp_times[time_bin(static_cast<std::uint64_t>(life))];
    add_to_figures(figures, tally);
    if (batches != nullptr) add_to_figures(figures, batches->counts);
    add_times(figures, run, machine.now(), last, left_at_last + issued - issued_at_last);
    figures.single_warp_clocks = figures.free_block_clocks = figures.scheduled_clocks;
}

/// What a warp that is alone on its multiprocessor takes for each operation. Its instructions wait
/// for each other; a read at the start of one waits for memory. A stack of the warp's own lies in
/// shared memory, which counts as an instruction like others.
OpClocks op_clocks(const MachineModel& machine, const OpCosts& costs, bool local_stacks) {
    OpClocks clocks{};
    for (std::size_t k = 0; k < op_count; ++k) {
        clocks[k] = costs[k] * machine.warp_issue_clocks;
        if (waits_for_read(static_cast<Op>(k))) clocks[k] += machine.read_clocks;
    }
    if (local_stacks) clocks[static_cast<std::size_t>(Op::pop)] += machine.stack_read_clocks;
    return clocks;
}

Simulation empty_figures(const OpCosts& costs) {
    Simulation figures;
    for (std::size_t k = 0; k < op_count; ++k)
        figures.operations.push_back({op_names[k], 0, 0, costs[k]});
    return figures;
}

}  // namespace

namespace {

/// The row of a machine's table that holds for the kernel, of each operation.
std::vector<const OperationCost*> table_of(const MachineModel& machine, WarpKernel kernel) {
    std::vector<const OperationCost*> found(op_count);
    std::set<std::pair<std::string_view, std::string_view>> seen;
    const std::string told = "machine " + machine.name + ": operation '";
    for (const OperationCost& cost : machine.costs) {
        const auto name = std::find(op_names.begin(), op_names.end(), cost.operation);
        if (name == op_names.end())
            throw InputError("machine " + machine.name + ": there is no operation '" +
                             cost.operation + "'");
        if (!seen.insert({cost.operation, cost.kernel}).second)
            throw InputError(told + cost.operation + "' has two costs" +
                             (cost.kernel.empty() ? "" : " in kernel " + cost.kernel));
        const bool own = !cost.kernel.empty();
        if (own && warp_kernel_from_name(cost.kernel) != kernel) continue;
        const auto k = static_cast<std::size_t>(name - op_names.begin());
        if (own || found[k] == nullptr) found[k] = &cost;
    }
    for (std::size_t k = 0; k < op_count; ++k)
        if (found[k] == nullptr)
            throw InputError(told + std::string(op_names[k]) + "' has no cost in kernel " +
                             std::string(warp_kernel_name(kernel)));
    return found;
}

OpCosts column_of(const MachineModel& machine, WarpKernel kernel,
                  std::uint32_t OperationCost::*column) {
    const std::vector<const OperationCost*> table = table_of(machine, kernel);
    OpCosts costs{};
    for (std::size_t k = 0; k < op_count; ++k) costs[k] = table[k]->*column;
    return costs;
}

}  // namespace

OpCosts op_costs(const MachineModel& machine, WarpKernel kernel) {
    return column_of(machine, kernel, &OperationCost::instructions);
}

OpCosts op_half_rates(const MachineModel& machine, WarpKernel kernel) {
    return column_of(machine, kernel, &OperationCost::half_rate);
}

Simulation simulate_launch(const WarpScene& scene, std::uint32_t stack_entries,
                           std::span<const Ray> rays, std::span<TreeHit> hits,
                           const SimulateOptions& options, std::span<const MemoryRange> memory,
                           const BatchWork* batches) {
    std::uint32_t next = 0;
    const MachineModel& m = options.machine;
    const SimulatedKernel& kernel =
        *simulated_kernel(options.kernel, options.any_hit, options.width);
    const OpCosts costs = op_costs(m, options.kernel);
    LaunchRun run{
        options,
        kernel,
        {scene, {rays.data(), hits.data(), static_cast<std::uint32_t>(rays.size()), &next}},
        stack_entries,
        costs,
        op_clocks(m, costs, kernel.local_stacks),
        nullptr};
    if (options.memory) {
        std::vector<MemoryRange> ranges(memory.begin(), memory.end());
        ranges.push_back({rays.data(), rays.size_bytes()});
        ranges.push_back({hits.data(), hits.size_bytes()});
        run.memory = std::make_unique<MemoryModel>(m, run.width(), stack_entries, ranges);
    }
    Simulation figures = empty_figures(run.costs);
    figures.launches = 1;
    figures.rays = rays.size();
    if (rays.empty()) return figures;
    if (run.kernel.persistent) {
        run_persistent(run, batches, figures);
    } else {
        std::optional<BatchWork> own;
        if (batches == nullptr) batches = &own.emplace(watched_batches(run));
        add_batch_times(run, works_of(run, *batches, figures), figures);
    }
    for (const OperationFigure& op : figures.operations)
        figures.lane_instructions += op.lanes * op.instructions;
    figures.hits = static_cast<std::uint64_t>(
        std::count_if(hits.begin(), hits.end(), [](const TreeHit& hit) { return hit.hit(); }));
    if (run.memory) {
        run.memory->finish();
        const MemoryTraffic& traffic = run.memory->traffic();
        figures.texture_fetches = traffic.texture_fetches;
        figures.l1_transactions = traffic.l1_requests;
        figures.replays = traffic.replays;
        figures.l2_bytes = traffic.l2_bytes;
        figures.dram_bytes = traffic.dram_bytes;
        figures.memory_wait_clocks = traffic.wait_clocks;
    }
    return figures;
}

}  // namespace raydix
