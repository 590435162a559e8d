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
    std::unique_ptr<MemoryModel> memory;

    [[nodiscard]] std::uint32_t width() const { return static_cast<std::uint32_t>(options.width); }
    [[nodiscard]] IssueRates rates() const {
        const MachineModel& m = options.machine;
        return {m.lanes_per_clock / options.width, 1.0 / m.warp_issue_clocks};
    }
    [[nodiscard]] WarpSetup setup(WarpTally& tally) const {
        return {&costs, &tally, memory.get(), stack_entries};
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
    const double slots_per_clock = run.rates().shared * run.options.machine.multiprocessors;
    figures.scheduled_clocks += clocks;
    figures.issue_slots += clocks * slots_per_clock;
    figures.idle_issues += std::max(0.0, (clocks - last_handed_out) * slots_per_clock - work_after);
}

/// Instructions of each warp, in the order of the launch.
std::vector<std::uint64_t> run_batches(const LaunchRun& run, Simulation& figures) {
    const std::size_t warps = (run.job.launch.count + run.width() - 1) / run.width();
    std::vector<std::uint64_t> times(warps);
    const std::size_t tasks = (warps + warps_per_task - 1) / warps_per_task;
    std::vector<WarpTally> tallies(tasks);
    const auto task = [&](std::size_t index, std::size_t begin, std::size_t end) {
        WarpTally& tally = tallies[index];
        WarpMemoryPool memory(run.kernel, 1, run.setup(tally));
        KernelState state;
        for (std::size_t w = begin; w < end; ++w) {
            const std::uint64_t before = tally.issued;
            if (run.memory)
                run.memory->run_on(
                    static_cast<std::uint32_t>(w * run.width() / run.options.machine.block_lanes %
                                               run.options.machine.multiprocessors));
            run.kernel.start_kernel(state);
            run.kernel.turn(memory.at(0), state, run.job, static_cast<std::uint32_t>(w));
            times[w] = tally.issued - before;
        }
    };
    if (run.memory) {  // one cache, one order
        for (std::size_t t = 0; t < tasks; ++t)
            task(t, t * warps_per_task, std::min(warps, (t + 1) * warps_per_task));
    } else {
        for_each_block(warps, warps_per_task, task);
    }
    for (const WarpTally& tally : tallies) add_tally(figures, tally);
    for (const std::uint64_t time : times) ++figures.warp_times[time_bin(time)];
    return times;
}

/// Blocks go in order to whichever multiprocessor has room; a block's place is free again when its
/// last warp is done.
void schedule_blocks(const LaunchRun& run, const std::vector<std::uint64_t>& times,
                     Simulation& figures) {
    const MachineModel& m = run.options.machine;
    const std::size_t block_warps = std::max(1u, m.block_lanes / run.width());
    const std::size_t blocks = (times.size() + block_warps - 1) / block_warps;
    const std::size_t places =
        std::max(1u, m.resident_lanes / std::max(m.block_lanes, run.width()));
    Multiprocessors machine(m.multiprocessors, run.rates());
    std::vector<std::uint32_t> left(blocks);
    std::size_t next = 0;
    double last = 0, work_after = 0;
    const auto dispatch = [&](std::uint32_t place) {
        const std::size_t end = std::min(times.size(), (next + 1) * block_warps);
        for (std::size_t w = next * block_warps; w < end; ++w, ++left[next])
            machine.add(place, static_cast<std::uint32_t>(w), times[w]);
        if (++next == blocks) last = machine.now(), work_after = machine.work_left();
    };
    for (std::size_t k = 0; k < places * m.multiprocessors && next < blocks; ++k)
        dispatch(static_cast<std::uint32_t>(k % m.multiprocessors));
    while (!machine.idle()) {
        const Multiprocessors::Finished done = machine.next();
        if (--left[done.warp / block_warps] == 0 && next < blocks) dispatch(done.place);
    }
    add_times(figures, run, machine.now(), last, work_after);
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
    Multiprocessors machine(m.multiprocessors, run.rates());
    const RayLaunch& launch = run.job.launch;
    double last = 0, left_at_last = 0;
    std::uint64_t issued_at_last = 0;
    const auto turn = [&](std::uint32_t place, std::uint32_t warp) {
        const std::uint64_t before = tally.issued;
        const bool more_rays = *launch.next < launch.count;
        if (run.memory) run.memory->run_on(place);
        done[warp] = !run.kernel.turn(memory.at(run.kernel.keeps_rays ? warp : 0), states[warp],
                                      run.job, warp);
        const std::uint64_t time = tally.issued - before;
        lives[warp] += time;
        if (!run.kernel.keeps_rays && !done[warp]) ++figures.warp_times[time_bin(time)];
        machine.add(place, warp, time);
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
    LaunchRun run{
        options,
        *simulated_kernel(options.kernel, options.any_hit, options.width),
        {scene, {rays.data(), hits.data(), static_cast<std::uint32_t>(rays.size()), &next}},
        stack_entries,
        op_costs(options.machine, options.kernel),
        nullptr};
    const MachineModel& m = options.machine;
    if (options.memory) {
        std::vector<MemoryRange> ranges(memory.begin(), memory.end());
        ranges.push_back({rays.data(), rays.size_bytes()});
        run.memory =
            std::make_unique<MemoryModel>(m.multiprocessors, m.l1_bytes, m.l2_bytes, ranges);
    }
    Simulation figures = empty_figures(run.costs);
    figures.launches = 1;
    figures.rays = rays.size();
    if (rays.empty()) return figures;
    if (run.kernel.persistent) {
        run_persistent(run, figures);
    } else {
        schedule_blocks(run, run_batches(run, figures), figures);
    }
    for (const OperationFigure& op : figures.operations)
        figures.lane_instructions += op.lanes * op.instructions;
    figures.hits = static_cast<std::uint64_t>(
        std::count_if(hits.begin(), hits.end(), [](const TreeHit& hit) { return hit.hit(); }));
    if (run.memory) {
        figures.l1_transactions = run.memory->l1_transactions();
        figures.l2_bytes = run.memory->l2_bytes();
        figures.dram_bytes = run.memory->dram_bytes();
    }
    return figures;
}

}  // namespace raydix
