// Warps of a launch -> their instructions -> clocks on a machine. Kernels whose warps have fixed
// batches run over all threads, then their times are scheduled block by block; kernels that fetch
// run in order of simulated time, because who fetches first decides who traces which ray.
#include "trace/warp/simulate_launch.h"

#include <raydix/error.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "exec/memory.h"
#include "exec/parallel.h"
#include "simt/memory_model.h"
#include "simt/schedule.h"
#include "trace/warp/simulated_kernels.h"

namespace raydix {
namespace {

constexpr std::size_t warps_per_task = 256;

std::size_t time_bin(std::uint64_t instructions) {
    if (instructions < 1) return 0;
    const auto bin = static_cast<std::size_t>(8.0 * std::log2(static_cast<double>(instructions)));
    return std::min<std::size_t>(bin, 255);
}

/// Lanes and stacks of a number of warps.
class WarpMemoryPool {
public:
    WarpMemoryPool(const SimulatedKernel& kernel, std::size_t warps, const WarpSetup& setup)
        : stride_(kernel.warp_bytes(setup.stack_entries)), memory_(stride_ * warps) {
        for (std::size_t k = 0; k < warps; ++k) kernel.start_warp(at(k), setup);
    }
    [[nodiscard]] std::byte* at(std::size_t k) { return memory_.data() + k * stride_; }

private:
    std::size_t stride_;
    Buffer<std::byte> memory_;
};

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
    [[nodiscard]] WarpSetup setup(WarpTally& tally) const {
        return {&costs, &tally, memory.get(), stack_entries, &clocks};
    }
};

void add_tally(Simulation& figures, const WarpTally& tally) {
    figures.instructions += tally.issued;
    for (std::size_t k = 0; k < op_count; ++k) {
        figures.operations[k].issues += tally.counts[k].issues;
        figures.operations[k].lanes += tally.counts[k].lanes;
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

WarpWork work_between(const WarpTally& before, const WarpTally& after) {
    return {static_cast<double>(after.issued - before.issued),
            after.alone_clocks - before.alone_clocks};
}

/// What each warp does, in the order of the launch.
std::vector<WarpWork> run_batches(const LaunchRun& run, Simulation& figures) {
    const std::size_t warps = (run.job.launch.count + run.width() - 1) / run.width();
    std::vector<WarpWork> works(warps);
    const std::size_t tasks = (warps + warps_per_task - 1) / warps_per_task;
    std::vector<WarpTally> tallies(tasks);
    const auto task = [&](std::size_t index, std::size_t begin, std::size_t end) {
        WarpTally& tally = tallies[index];
        WarpMemoryPool memory(run.kernel, 1, run.setup(tally));
        KernelState state;
        for (std::size_t w = begin; w < end; ++w) {
            const WarpTally before = tally;
            run.kernel.start_kernel(state);
            run.kernel.turn(memory.at(0), state, run.job, static_cast<std::uint32_t>(w));
            if (run.memory)
                run.memory->hand_over(
                    static_cast<std::uint32_t>(w * run.width() / run.options.machine.block_lanes %
                                               run.options.machine.multiprocessors));
            works[w] = work_between(before, tally);
        }
    };
    if (run.memory) {  // one cache, one order
        for (std::size_t t = 0; t < tasks; ++t)
            task(t, t * warps_per_task, std::min(warps, (t + 1) * warps_per_task));
    } else {
        for_each_block(warps, warps_per_task, task);
    }
    for (const WarpTally& tally : tallies) add_tally(figures, tally);
    for (const WarpWork& work : works)
        ++figures.warp_times[time_bin(static_cast<std::uint64_t>(work.instructions))];
    return works;
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

/// Persistent warps, each turn at its time.
void run_persistent(const LaunchRun& run, Simulation& figures) {
    const MachineModel& m = run.options.machine;
    const std::uint32_t filling = std::max(1u, m.resident_lanes / run.width()) * m.multiprocessors;
    // No more warps than batches: those would only find the pool empty.
    const std::uint32_t batches = (run.job.launch.count - 1) / run.width() + 1;
    const std::uint32_t warps = std::clamp(
        static_cast<std::uint32_t>(std::ceil(filling * run.options.part_of_launch)), 1u, batches);
    WarpTally tally;
    WarpMemoryPool memory(run.kernel, run.kernel.keeps_rays ? warps : 1, run.setup(tally));
    std::vector<KernelState> states(warps);
    std::vector<std::uint64_t> lives(warps);
    std::vector<bool> done(warps);
    Multiprocessors machine(m.multiprocessors, run.slots());
    const RayLaunch& launch = run.job.launch;
    double last = 0, left_at_last = 0;
    std::uint64_t issued_at_last = 0;
    const auto turn = [&](std::uint32_t place, std::uint32_t warp) {
        const WarpTally before = tally;
        const bool more_rays = *launch.next < launch.count;
        done[warp] = !run.kernel.turn(memory.at(run.kernel.keeps_rays ? warp : 0), states[warp],
                                      run.job, warp);
        if (run.memory) run.memory->hand_over(place);
        const std::uint64_t time = tally.issued - before.issued;
        lives[warp] += time;
        if (!run.kernel.keeps_rays && !done[warp]) ++figures.warp_times[time_bin(time)];
        machine.add(place, warp, work_between(before, tally));
        if (more_rays && *launch.next >= launch.count)
            last = machine.now(), left_at_last = machine.work_left(), issued_at_last = tally.issued;
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
        for (const std::uint64_t life : lives) ++figures.warp_times[time_bin(life)];
    add_tally(figures, tally);
    add_times(figures, run, machine.now(), last,
              left_at_last + static_cast<double>(tally.issued - issued_at_last));
    figures.single_warp_clocks = figures.free_block_clocks = figures.scheduled_clocks;
}

/// What a warp that is alone on its multiprocessor takes for each operation. Its instructions wait
/// for each other; a read at the start of one waits for memory. A stack of the warp's own lies in
/// shared memory, which counts as an instruction like others.
OpClocks op_clocks(const MachineModel& machine, const OpCosts& costs, bool one_stack) {
    OpClocks clocks{};
    for (std::size_t k = 0; k < op_count; ++k) {
        clocks[k] = costs[k] * machine.warp_issue_clocks;
        if (waits_for_read(static_cast<Op>(k))) clocks[k] += machine.read_clocks;
    }
    if (!one_stack) clocks[static_cast<std::size_t>(Op::pop)] += machine.stack_read_clocks;
    return clocks;
}

Simulation empty_figures(const OpCosts& costs) {
    Simulation figures;
    for (std::size_t k = 0; k < op_count; ++k)
        figures.operations.push_back({op_names[k], 0, 0, costs[k]});
    return figures;
}

}  // namespace

OpCosts op_costs(const MachineModel& machine, WarpKernel kernel) {
    OpCosts costs{};
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
    for (std::size_t k = 0; k < op_count; ++k) {
        if (found[k] == nullptr)
            throw InputError(told + std::string(op_names[k]) + "' has no cost");
        costs[k] = found[k]->instructions;
    }
    return costs;
}

Simulation simulate_launch(const WarpScene& scene, std::uint32_t stack_entries,
                           std::span<const Ray> rays, std::span<TreeHit> hits,
                           const SimulateOptions& options, std::span<const MemoryRange> memory) {
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
        op_clocks(m, costs, kernel.one_stack),
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
        run_persistent(run, figures);
    } else {
        add_batch_times(run, run_batches(run, figures), figures);
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
