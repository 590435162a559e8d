// Public calls of the warp simulator: trees in the kernels' form, launches, rates.
#include <fmt/format.h>
#include <raydix/cwbvh.h>
#include <raydix/error.h>
#include <raydix/simulate.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string>

#include "base/options.h"
#include "exec/parallel.h"
#include "layout/warp_tree.h"
#include "trace/warp/batch_work.h"
#include "trace/warp/kernel_list.h"
#include "trace/warp/prepare_rays.h"
#include "trace/warp/residency.h"
#include "trace/warp/simulate_launch.h"
#include "trace/warp/warp_scene.h"

namespace raydix {
namespace {

constexpr std::array kernels{WarpKernel::packet,
                             WarpKernel::while_while,
                             WarpKernel::if_if,
                             WarpKernel::speculative_while_while,
                             WarpKernel::persistent_packet,
                             WarpKernel::persistent_while_while,
                             WarpKernel::persistent_if_if,
                             WarpKernel::persistent_speculative_while_while,
                             WarpKernel::ray_replacement,
                             WarpKernel::work_queue,
                             WarpKernel::dynamic_fetch,
                             WarpKernel::cwbvh,
                             WarpKernel::short_stack,
                             WarpKernel::persistent_cwbvh,
                             WarpKernel::persistent_short_stack};
constexpr std::array<std::string_view, kernels.size()> kernel_names{
    "packet",
    "while_while",
    "if_if",
    "speculative_while_while",
    "persistent_packet",
    "persistent_while_while",
    "persistent_if_if",
    "persistent_speculative_while_while",
    "ray_replacement",
    "work_queue",
    "dynamic_fetch",
    "cwbvh",
    "short_stack",
    "persistent_cwbvh",
    "persistent_short_stack"};

constexpr std::array<std::string_view, 3> release_names{"own", "in_order", "together"};

/// The memory model looks at each sector of a line.
constexpr std::uint32_t largest_line_bytes = 4096;

/// What no machine can have, whatever each figure is by itself.
void check_together(const MachineModel& m, int width) {
    const auto refuse = [&](const std::string& what) {
        throw InputError("machine " + m.name + ": " + what);
    };
    if (m.resident_lanes % static_cast<std::uint32_t>(width) != 0)
        refuse("resident_lanes is " + std::to_string(m.resident_lanes) +
               "; it must be a multiple of the warp's width, " + std::to_string(width));
    if (m.block_lanes > m.resident_lanes)
        refuse("block_lanes is " + std::to_string(m.block_lanes) +
               "; it must be at most resident_lanes, " + std::to_string(m.resident_lanes));
    for (const OperationCost& cost : m.costs) {
        if (cost.half_rate > cost.instructions)
            refuse("costs: half_rate of '" + cost.operation + "' is " +
                   std::to_string(cost.half_rate) + "; it must be at most its instructions, " +
                   std::to_string(cost.instructions));
        if (cost.most != 0 && cost.most < cost.instructions)
            refuse("costs: most of '" + cost.operation + "' is " + std::to_string(cost.most) +
                   "; it must be at least its instructions, " + std::to_string(cost.instructions));
    }
}

void check_options(const SimulateOptions& options) {
    check_enum("kernel", options.kernel, kernels.back());
    const MachineModel& m = options.machine;
    if (options.width < 1 || options.width > 128 || (options.width & (options.width - 1)) != 0)
        throw InputError("width is " + std::to_string(options.width) +
                         "; it must be 1, 2, 4, 8, 16, 32, 64 or 128");
    const auto refuse = [&](const char* field, auto value, const char* bounds) {
        throw InputError(
            fmt::format("machine {}: {} is {}; it must be {}", m.name, field, value, bounds));
    };
    const auto positive = [&](const char* field, std::uint32_t value) {
        if (value == 0) refuse(field, value, "above 0");
    };
    const auto rate = [&](const char* field, double value) {
        if (!(value >= 1e-6 && value <= 1e15)) refuse(field, value, "from 1e-6 to 1e15");
    };
    positive("multiprocessors", m.multiprocessors);
    rate("clock_ghz", m.clock_ghz);
    rate("lanes_per_clock", m.lanes_per_clock);
    rate("warp_issue_clocks", m.warp_issue_clocks);
    const auto not_negative = [&](const char* field, double value) {
        if (!(value >= 0 && value <= 1e9)) refuse(field, value, "from 0 to 1e9");
    };
    not_negative("read_clocks", m.read_clocks);
    not_negative("stack_read_clocks", m.stack_read_clocks);
    check_enum("block_release", m.block_release, BlockRelease::together);
    positive("resident_lanes", m.resident_lanes);
    positive("block_lanes", m.block_lanes);
    check_together(m, options.width);
    if (!(options.part_of_launch > 0 && options.part_of_launch <= 1))
        throw InputError("part_of_launch is " + std::to_string(options.part_of_launch) +
                         "; it must be above 0 and at most 1");
    if (double(m.resident_lanes) * m.multiprocessors > 1 << 24)
        throw InputError("machine " + m.name + ": more than 2^24 lanes in flight");
    if (!options.memory) return;
    rate("l1_transactions_per_clock", m.l1_transactions_per_clock);
    rate("l2_gb_per_s", m.l2_gb_per_s);
    rate("dram_gb_per_s", m.dram_gb_per_s);
    positive("l1_line_bytes", m.l1_line_bytes);
    if (m.l1_line_bytes % 32 != 0 || m.l1_line_bytes > largest_line_bytes)
        throw InputError(
            "machine " + m.name + ": l1_line_bytes is " + std::to_string(m.l1_line_bytes) +
            "; it must be a multiple of 32 and at most " + std::to_string(largest_line_bytes));
    not_negative("texture_fetches_per_clock", m.texture_fetches_per_clock);
    not_negative("texture_clocks", m.texture_clocks);
    not_negative("l1_clocks", m.l1_clocks);
    not_negative("l2_clocks", m.l2_clocks);
    not_negative("dram_clocks", m.dram_clocks);
    if (m.texture_bytes > 0) {
        positive("texture_sharers", m.texture_sharers);
        rate("texture_fetches_per_clock", m.texture_fetches_per_clock);
    }
    positive("l2_bytes", m.l2_bytes);
    // The model keeps a record for each 32 bytes of cache.
    if ((double(m.l1_bytes) + m.texture_bytes) * m.multiprocessors + m.l2_bytes > 1 << 30)
        throw InputError("machine " + m.name +
                         ": l1_bytes of all multiprocessors and l2_bytes are more than 2^30");
}

Simulation without_tree(const SimulateOptions& options, std::size_t rays) {
    Simulation figures;
    const OpCosts costs = op_costs(options.machine, options.kernel);
    for (std::size_t k = 0; k < op_count; ++k)
        figures.operations.push_back({op_names[k], 0, 0, costs[k]});
    figures.rays = rays;
    figures.launches = 1;
    return figures;
}

}  // namespace

std::span<const WarpKernel> warp_kernels() { return kernels; }

std::span<const WarpKernel> warp_kernel_family() {
    return std::span(kernels).first(static_cast<std::size_t>(WarpKernel::dynamic_fetch) + 1);
}

std::string_view warp_kernel_name(WarpKernel kernel) {
    const auto k = static_cast<std::size_t>(kernel);
    return k < kernel_names.size() ? kernel_names[k] : "unknown";
}

bool reads_wide_nodes(WarpKernel kernel) {
    return kernel == WarpKernel::cwbvh || kernel == WarpKernel::persistent_cwbvh;
}

bool has_short_stack(WarpKernel kernel) {
    return kernel == WarpKernel::short_stack || kernel == WarpKernel::persistent_short_stack;
}

WarpKernel warp_kernel_from_name(std::string_view name) {
    std::string known;
    for (const WarpKernel kernel : kernels) {
        if (warp_kernel_name(kernel) == name) return kernel;
        known += (known.empty() ? "" : ", ") + std::string(warp_kernel_name(kernel));
    }
    throw InputError("kernel '" + std::string(name) + "' is not known; there are " + known);
}

std::span<const std::string_view> block_release_names() { return release_names; }

std::string_view block_release_name(BlockRelease release) {
    const auto k = static_cast<std::size_t>(release);
    return k < release_names.size() ? release_names[k] : "unknown";
}

namespace {

WarpTree::Arrays::Wide wide_of(const Bvh& bvh) {
    const Cwbvh cwbvh(bvh);
    const Cwbvh::Arrays& from = cwbvh.arrays();
    WarpTree::Arrays::Wide wide;
    wide.bounds = from.bounds;
    wide.padding = pair_padding(bvh.nodes()[0]);
    wide.max_depth = cwbvh.stats().max_depth;
    wide.nodes.reset(from.nodes.size());
    std::copy_n(from.nodes.data(), from.nodes.size(), wide.nodes.data());
    wide.triangles.reset(from.triangles.size());
    wide.ids.reset(from.triangles.size());
    for_each_index(from.triangles.size(), [&](std::size_t i) {
        const CwbvhTriangle& t = from.triangles[i];
        wide.triangles[i] = make_woop_triangle({t.v0, t.v1, t.v2});
        wide.ids[i] = t.prim;
    });
    return wide;
}

}  // namespace

WarpTree::WarpTree(const Bvh& bvh, bool wide_nodes) : arrays_(std::make_unique<Arrays>()) {
    if (bvh.empty()) return;
    if (bvh.kind() != PrimitiveKind::triangles)
        throw InputError(std::string("rays need triangles; this tree holds ") +
                         (bvh.kind() == PrimitiveKind::points ? "points" : "boxes"));
    const std::size_t references = bvh.order().size();
    const std::uint32_t inner = bvh.inner_count();
    arrays_->max_depth = bvh.max_depth();
    arrays_->pairs.reset(std::max(inner, 1u));
    arrays_->triangles.reset(references);
    arrays_->ids.reset(references);
    const EmitNodePair emit_pair{bvh.nodes().data(), &inner, bvh.order().data(),
                                 arrays_->pairs.data(), arrays_->ids.data()};
    for_each_index(arrays_->pairs.size(),
                   [&](std::size_t r) { emit_pair(static_cast<std::uint32_t>(r)); });
    const EmitWoopTriangle emit_triangle{bvh.triangles().data(), arrays_->triangles.data()};
    for_each_index(references,
                   [&](std::size_t i) { emit_triangle(static_cast<std::uint32_t>(i)); });
    if (wide_nodes) arrays_->wide = wide_of(bvh);
}

WarpTree::~WarpTree() = default;
WarpTree::WarpTree(WarpTree&&) noexcept = default;
WarpTree& WarpTree::operator=(WarpTree&&) noexcept = default;

bool WarpTree::has_wide_nodes() const { return !arrays_->wide.ids.empty(); }
bool WarpTree::empty() const { return arrays_->ids.empty(); }
std::uint32_t WarpTree::max_depth() const { return arrays_->max_depth; }
std::uint64_t WarpTree::bytes() const {
    return arrays_->pairs.size() * sizeof(NodePair) +
           (arrays_->triangles.size() + arrays_->wide.triangles.size()) * sizeof(WoopTriangle) +
           (arrays_->ids.size() + arrays_->wide.ids.size()) * 4 +
           arrays_->wide.nodes.size() * sizeof(CwbvhNode);
}

void trace_reference(const WarpTree& tree, std::span<const Ray> rays, std::span<TreeHit> hits,
                     bool any_hit, int threads) {
    if (rays.size() != hits.size())
        throw InputError("trace_reference: " + std::to_string(rays.size()) +
                         " rays, but room for " + std::to_string(hits.size()) + " hits");
    check_threads(threads);
    std::fill(hits.begin(), hits.end(), TreeHit{});
    if (tree.empty()) return;
    const PreparedRays prepared(rays);
    const WarpJob job{
        scene_of(tree),
        {prepared.rays().data(), hits.data(), static_cast<std::uint32_t>(rays.size()), nullptr}};
    with_threads(threads, [&] {
        for_each_range(rays.size(), 256, [&](std::size_t begin, std::size_t end) {
            std::vector<std::int32_t> stack(tree.max_depth() + 1);
            one_by_one(any_hit)(job, begin, end, stack.data());
        });
    });
    prepared.rescale(hits);
}

void Simulation::add(const Simulation& other) {
    if (other.operations.empty()) return;
    if (operations.empty()) {
        *this = other;
        return;
    }
    rays += other.rays, launches += other.launches, hits += other.hits;
    for (std::size_t k = 0; k < operations.size(); ++k) {
        operations[k].issues += other.operations[k].issues;
        operations[k].lanes += other.operations[k].lanes;
    }
    instructions += other.instructions;
    lane_instructions += other.lane_instructions;
    scheduled_clocks += other.scheduled_clocks;
    single_warp_clocks += other.single_warp_clocks;
    free_block_clocks += other.free_block_clocks;
    idle_issues += other.idle_issues;
    issue_slots += other.issue_slots;
    for (std::size_t k = 0; k < warp_times.size(); ++k) warp_times[k] += other.warp_times[k];
    texture_fetches += other.texture_fetches;
    replays += other.replays;
    memory_wait_clocks += other.memory_wait_clocks;
    l1_transactions += other.l1_transactions;
    l2_bytes += other.l2_bytes;
    dram_bytes += other.dram_bytes;
}

namespace {

/// Instructions that half of the lanes execute, in all.
std::uint64_t half_rate_instructions(const Simulation& s, const SimulateOptions& options) {
    const OpCosts half = op_half_rates(options.machine, options.kernel);
    std::uint64_t sum = 0;
    for (std::size_t k = 0; k < s.operations.size(); ++k) sum += s.operations[k].issues * half[k];
    return sum;
}

std::vector<SimulatedRates::Limit> memory_limits(const Simulation& s,
                                                 const SimulateOptions& options) {
    const MachineModel m = machine_for(options);
    std::vector<SimulatedRates::Limit> limits;
    const double clocks_per_us = m.clock_ghz * 1e3 * m.multiprocessors;
    const auto add = [&](std::string_view name, double us) {
        if (us > 0) limits.push_back({name, static_cast<double>(s.rays) / us});
    };
    if (m.replays)
        add("replays", static_cast<double>(s.instructions + s.replays) * options.width /
                           m.lanes_per_clock / clocks_per_us);
    if (m.texture_fetches_per_clock > 0)
        add("texture",
            static_cast<double>(s.texture_fetches) / m.texture_fetches_per_clock / clocks_per_us);
    if (m.l1_bytes > 0)
        add("l1",
            static_cast<double>(s.l1_transactions) / m.l1_transactions_per_clock / clocks_per_us);
    const std::uint64_t half = half_rate_instructions(s, options);
    add("half_rate",
        static_cast<double>(2 * half) * options.width / m.lanes_per_clock / clocks_per_us);
    add("l2", static_cast<double>(s.l2_bytes) / (m.l2_gb_per_s * 1e3));
    add("dram", static_cast<double>(s.dram_bytes) / (m.dram_gb_per_s * 1e3));
    // Warps in flight, each with its own instructions and waits one after the other.
    const double alone =
        static_cast<double>(s.instructions) * m.warp_issue_clocks + s.memory_wait_clocks;
    add("latency", alone / std::max(1u, m.resident_lanes / static_cast<unsigned>(options.width)) /
                       clocks_per_us);
    return limits;
}

}  // namespace

SimulatedRates simulated_rates(const Simulation& s, const SimulateOptions& options) {
    const MachineModel& m = options.machine;
    SimulatedRates rates;
    if (s.instructions == 0) return rates;
    const double clocks_per_us = m.clock_ghz * 1e3;
    const double rays = static_cast<double>(s.rays);
    const double issue_clocks = static_cast<double>(s.instructions) * options.width /
                                (m.lanes_per_clock * m.multiprocessors);
    rates.bound = rays / (issue_clocks / clocks_per_us);
    rates.scheduled = rays / (s.scheduled_clocks / clocks_per_us);
    rates.single_warps = rays / (s.single_warp_clocks / clocks_per_us);
    rates.free_blocks = rays / (s.free_block_clocks / clocks_per_us);
    rates.simd_efficiency = static_cast<double>(s.lane_instructions) /
                            (static_cast<double>(s.instructions) * options.width);
    if (!options.memory) return rates;
    rates.memory_limits = memory_limits(s, options);
    rates.memory = rates.bound;
    rates.memory_limit = "issue";
    for (const SimulatedRates::Limit& limit : rates.memory_limits)
        if (limit.mrays_per_s < rates.memory)
            rates.memory = limit.mrays_per_s, rates.memory_limit = limit.name;
    return rates;
}

namespace {

/// Whether all that a run asks of the rays is in a BatchWork.
bool shares_batches(const SimulateOptions& run) { return !run.memory && batch_kernel(run.kernel); }

/// Runs whose warps trace the same batches stand together, each other run alone.
std::vector<std::vector<std::size_t>> groups_of(std::span<const SimulateOptions> runs) {
    std::vector<std::vector<std::size_t>> groups;
    for (std::size_t k = 0; k < runs.size(); ++k) {
        const auto same = [&](const std::vector<std::size_t>& group) {
            const SimulateOptions& other = runs[group.front()];
            return shares_batches(runs[k]) && shares_batches(other) &&
                   batch_kernel(runs[k].kernel) == batch_kernel(other.kernel) &&
                   runs[k].any_hit == other.any_hit && runs[k].width == other.width;
        };
        const auto found = std::find_if(groups.begin(), groups.end(), same);
        (found != groups.end() ? *found : groups.emplace_back()).push_back(k);
    }
    return groups;
}

BatchWork batch_work(const WarpScene& scene, std::uint32_t stack_entries, std::span<const Ray> rays,
                     std::span<TreeHit> hits, const SimulateOptions& run) {
    const WarpJob job{scene,
                      {rays.data(), hits.data(), static_cast<std::uint32_t>(rays.size()), nullptr}};
    return trace_batches(*simulated_kernel(*batch_kernel(run.kernel), run.any_hit, run.width), job,
                         run.width, stack_entries);
}

}  // namespace

std::vector<Simulation> simulate(const WarpTree& tree, std::span<const Ray> rays,
                                 std::span<const SimulateOptions> asked,
                                 std::vector<std::vector<TreeHit>>* hits, int threads) {
    for (const SimulateOptions& options : asked) {
        check_options(options);
        static_cast<void>(op_costs(options.machine, options.kernel));
        if (reads_wide_nodes(options.kernel) && !tree.empty() && !tree.has_wide_nodes())
            throw InputError("simulate: the kernel " +
                             std::string(warp_kernel_name(options.kernel)) +
                             " needs a WarpTree with wide nodes");
        check_trail_levels(options.kernel, tree.max_depth());
    }
    check_threads(threads);
    std::vector<SimulateOptions> runs(asked.begin(), asked.end());
    for (SimulateOptions& run : runs) run.machine = machine_for(run);
    if (rays.size() >= 0x7FFFFFFFu) throw InputError("simulate: 2^31 rays or more in one launch");
    std::vector<Simulation> figures(runs.size());
    std::vector<std::vector<TreeHit>> own;
    std::vector<std::vector<TreeHit>>& found = hits != nullptr ? *hits : own;
    found.resize(runs.size());
    const PreparedRays prepared(rays);
    const WarpTree::Arrays& arrays = tree.arrays();
    const auto memory_of = [&](WarpKernel kernel) {
        const auto range = [](const auto& buffer, MemoryRange::Holds holds) {
            return MemoryRange{buffer.data(), buffer.view().size_bytes(), holds};
        };
        using enum MemoryRange::Holds;
        if (reads_wide_nodes(kernel))
            return std::array{range(arrays.wide.nodes, nodes),
                              range(arrays.wide.triangles, triangles),
                              range(arrays.wide.ids, triangles)};
        return std::array{range(arrays.pairs, nodes), range(arrays.triangles, triangles),
                          range(arrays.ids, triangles)};
    };
    const std::vector<std::vector<std::size_t>> groups = groups_of(runs);
    const auto run = [&](const std::vector<std::size_t>& group) {
        const WarpScene scene = scene_of(tree);
        const std::uint32_t stack_entries = arrays.stack_entries(runs[group.front()].kernel);
        std::vector<TreeHit>& first = found[group.front()];
        first.assign(rays.size(), TreeHit{});
        std::optional<BatchWork> batches;
        if (shares_batches(runs[group.front()]))
            batches = batch_work(scene, stack_entries, prepared.rays(), first, runs[group.front()]);
        for_each_index(
            group.size(),
            [&](std::size_t i) {
                const std::size_t k = group[i];
                figures[k] =
                    simulate_launch(scene, stack_entries, prepared.rays(), first, runs[k],
                                    memory_of(runs[k].kernel), batches ? &*batches : nullptr);
            },
            1);
        prepared.rescale(first);
        for (const std::size_t k : group)
            if (hits != nullptr && k != group.front()) found[k] = first;
        if (hits == nullptr) std::vector<TreeHit>().swap(first);
    };
    if (tree.empty()) {
        for (std::size_t k = 0; k < runs.size(); ++k) {
            found[k].assign(rays.size(), TreeHit{});
            figures[k] = without_tree(runs[k], rays.size());
        }
        return figures;
    }
    with_threads(threads, [&] {
        for_each_index(
            groups.size(), [&](std::size_t g) { run(groups[g]); }, 1);
    });
    return figures;
}

}  // namespace raydix
