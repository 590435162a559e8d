#include "trace/warp/batch_work.h"

#include <algorithm>

#include "exec/parallel.h"

namespace raydix {
namespace {

constexpr std::size_t batches_per_task = 256;

std::size_t batches_of(const WarpJob& job, int width) {
    const auto lanes = static_cast<std::size_t>(width);
    return (job.launch.count + lanes - 1) / lanes;
}

/// Batches [begin, end), one after the other.
template <class Done>
void trace_range(const SimulatedKernel& kernel, const WarpJob& job, WarpSetup setup,
                 std::size_t begin, std::size_t end, std::vector<OpIssues>& batches, OpCounts& sum,
                 const Done& done) {
    OpCounts counts{};
    setup.tally = &counts;
    WarpMemoryPool memory(kernel, 1, setup);
    KernelState state;
    for (std::size_t k = begin; k < end; ++k) {
        const OpCounts before = counts;
        kernel.start_kernel(state);
        kernel.turn(memory.at(0), state, job, static_cast<std::uint32_t>(k));
        for (std::size_t op = 0; op < op_count; ++op)
            batches[k][op] = static_cast<std::uint32_t>(counts[op].issues - before[op].issues);
        done(k);
    }
    sum = counts;
}

}  // namespace

std::optional<WarpKernel> batch_kernel(WarpKernel kernel) {
    switch (kernel) {
        case WarpKernel::persistent_packet:
            return WarpKernel::packet;
        case WarpKernel::persistent_while_while:
            return WarpKernel::while_while;
        case WarpKernel::persistent_if_if:
            return WarpKernel::if_if;
        case WarpKernel::persistent_speculative_while_while:
            return WarpKernel::speculative_while_while;
        case WarpKernel::persistent_cwbvh:
            return WarpKernel::cwbvh;
        case WarpKernel::persistent_short_stack:
            return WarpKernel::short_stack;
        default:
            if (simulated_kernel(kernel, false, 1)->persistent) return std::nullopt;
            return kernel;
    }
}

BatchWork trace_batches(const SimulatedKernel& kernel, const WarpJob& job, int width,
                        std::uint32_t stack_entries) {
    const std::size_t n = batches_of(job, width);
    BatchWork work;
    work.batches.resize(n);
    std::vector<OpCounts> parts((n + batches_per_task - 1) / batches_per_task);
    for_each_block(n, batches_per_task, [&](std::size_t part, std::size_t begin, std::size_t end) {
        trace_range(kernel, job, {nullptr, nullptr, stack_entries}, begin, end, work.batches,
                    parts[part], [](std::size_t) {});
    });
    for (const OpCounts& part : parts) add_counts(work.counts, part);
    return work;
}

BatchWork trace_batches_in_order(const SimulatedKernel& kernel, const WarpJob& job, int width,
                                 std::uint32_t stack_entries, MemoryObserver& observer,
                                 const std::function<void(std::size_t)>& done) {
    const std::size_t n = batches_of(job, width);
    BatchWork work;
    work.batches.resize(n);
    trace_range(kernel, job, {nullptr, &observer, stack_entries}, 0, n, work.batches, work.counts,
                done);
    return work;
}

}  // namespace raydix
