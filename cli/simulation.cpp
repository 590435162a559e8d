// Launches -> simulated figures -> tables and JSON.
#include "simulation.h"

#include <fmt/format.h>
#include <raydix/error.h>

#include <algorithm>
#include <cmath>

#include "simulation_state.h"

namespace raydix::cli {
namespace {

/// Pieces between commas; empty ones are usage errors of the caller's option.
std::vector<std::string> split(const std::string& text) {
    std::vector<std::string> parts{""};
    for (const char c : text) {
        if (c == ',')
            parts.emplace_back();
        else
            parts.back() += c;
    }
    return parts;
}

std::uint64_t count_different(std::span<const TreeHit> a, std::span<const TreeHit> b,
                              bool any_hit) {
    std::uint64_t different = 0;
    for (std::size_t i = 0; i < a.size(); ++i)
        different += any_hit ? a[i].hit() != b[i].hit()
                             : a[i].prim != b[i].prim || a[i].t != b[i].t || a[i].u != b[i].u ||
                                   a[i].v != b[i].v;
    return different;
}

/// One launch, or a run of one, through every row's kernel.
void add_unit(const WarpTree& tree, const RayUnit& unit, std::vector<SimulateOptions> runs,
              std::vector<SimulationRow>& rows, const CommonOptions& common) {
    for (SimulateOptions& run : runs) run.part_of_launch = unit.part;
    std::vector<std::vector<TreeHit>> hits;
    const std::vector<Simulation> figures = simulate(tree, unit.rays, runs, &hits, common.threads);
    std::vector<TreeHit> expected(unit.rays.size());
    trace_reference(tree, unit.rays, expected, runs.front().any_hit, common.threads);
    for (std::size_t k = 0; k < rows.size(); ++k) {
        rows[k].sum.add(figures[k]);
        rows[k].whole_launches &= unit.whole();
        rows[k].different_hits += count_different(hits[k], expected, runs[k].any_hit);
        const SimulatedRates rates = simulated_rates(figures[k], runs[k]);
        if (rates.bound > 0) rows[k].units.push_back(rates);
    }
}

Json or_null(bool known, double value) {
    return known && std::isfinite(value) ? Json(value) : Json(nullptr);
}

/// Warp times by octave and half octave, without the empty ends.
Json histogram_json(const Simulation& sum) {
    constexpr std::size_t per_octave = Simulation::bins_per_octave, per_bin = per_octave / 2;
    std::vector<double> edges;
    std::vector<std::uint64_t> counts;
    std::size_t first = sum.warp_times.size(), last = 0;
    for (std::size_t k = 0; k < sum.warp_times.size(); ++k)
        if (sum.warp_times[k] != 0) first = std::min(first, k), last = k;
    if (first > last) return {{"unit", "instructions"}, {"edges", edges}, {"counts", counts}};
    first = first / per_bin * per_bin;
    for (std::size_t k = first; k <= last; k += per_bin) {
        edges.push_back(std::exp2(static_cast<double>(k) / per_octave));
        std::uint64_t count = 0;
        for (std::size_t j = k; j < std::min(k + per_bin, sum.warp_times.size()); ++j)
            count += sum.warp_times[j];
        counts.push_back(count);
    }
    edges.push_back(edges.back() * std::exp2(double(per_bin) / per_octave));
    return {{"unit", "instructions"}, {"edges", edges}, {"counts", counts}};
}

Json operations_json(const SimulationRow& row) {
    Json all = Json::array();
    const auto rays = static_cast<double>(row.sum.rays);
    for (const OperationFigure& op : row.sum.operations) {
        if (op.issues == 0) continue;
        const double issued = static_cast<double>(op.issues) * op.instructions;
        all.push_back(
            {{"name", op.operation},
             {"issues_per_ray", static_cast<double>(op.issues) / rays},
             {"cost", op.instructions},
             {"simd_efficiency",
              static_cast<double>(op.lanes) / (static_cast<double>(op.issues) * row.options.width)},
             {"share",
              row.sum.instructions ? issued / static_cast<double>(row.sum.instructions) : 0.0}});
    }
    return all;
}

}  // namespace

double SimulatedRates::*SimulationRow::tightest_rate() const {
    const SimulatedRates found = rates();
    double SimulatedRates::*rate = &SimulatedRates::bound;
    if (whole_launches && found.scheduled < found.*rate) rate = &SimulatedRates::scheduled;
    if (has_memory() && found.memory < found.*rate) rate = &SimulatedRates::memory;
    return rate;
}

SimulatedRates::Limit SimulationRow::tightest() const {
    const SimulatedRates found = rates();
    const auto rate = tightest_rate();
    return {rate == &SimulatedRates::bound       ? "issue"
            : rate == &SimulatedRates::scheduled ? "scheduled"
                                                 : found.memory_limit,
            found.*rate};
}

double LaunchTimes::correction(std::size_t n) const {
    double sample_time = 0, sample_rays = 0, all_time = 0, all_rays = 0;
    for (std::size_t k = 0; k < time.size(); ++k) {
        all_time += time[k] * rays[k], all_rays += rays[k];
        if (k < n) sample_time += time[k] * rays[k], sample_rays += rays[k];
    }
    return sample_time > 0 && all_time > 0 ? all_rays / all_time * (sample_time / sample_rays)
                                           : 1.0;
}

double SimulationRow::correction() const {
    return all && part_taken < 1.0 ? all->correction(units.size()) : 1.0;
}

SimulatedRates SimulationRow::rates() const {
    SimulatedRates out = simulated_rates(sum, options);
    const double factor = correction();
    for (double* rate :
         {&out.bound, &out.scheduled, &out.single_warps, &out.free_blocks, &out.memory})
        *rate *= factor;
    for (SimulatedRates::Limit& limit : out.memory_limits) limit.mrays_per_s *= factor;
    return out;
}

std::vector<double> SimulationRow::deviations(double SimulatedRates::*rate) const {
    const std::size_t n = units.size();
    const auto known = [&](std::size_t k) { return all ? all->time.at(k) : 1.0; };
    double own = 0, beside = 0;
    for (std::size_t k = 0; k < n; ++k) own += 1.0 / (units[k].*rate), beside += known(k);
    const auto count = static_cast<double>(n);
    std::vector<double> out;
    for (std::size_t k = 0; k < n; ++k)
        out.push_back(count / (units[k].*rate) / own - count * known(k) / beside);
    return out;
}

double error_of_mean(std::span<const double> deviations, double part) {
    double squares = 0;
    for (const double deviation : deviations) squares += deviation * deviation;
    const auto n = static_cast<double>(deviations.size());
    return std::sqrt(squares / (n - 1) / n * (1.0 - part));
}

std::optional<double> SimulationRow::sampling_error() const {
    if (part_taken >= 1.0) return 0.0;
    if (units.size() < 2) return std::nullopt;
    const auto error_of = [&](double SimulatedRates::*rate) {
        return error_of_mean(deviations(rate), part_taken);
    };
    const double of_bound = error_of(&SimulatedRates::bound);
    return whole_launches ? std::max(of_bound, error_of(&SimulatedRates::scheduled)) : of_bound;
}

namespace {

/// A sample of fewer launches says too little of its own error.
constexpr std::size_t least_launches = 8;

/// The cheapest kernel whose launches take more or less time as those of `kernel` do.
WarpKernel kernel_like(WarpKernel kernel) {
    const bool packets = kernel == WarpKernel::packet || kernel == WarpKernel::persistent_packet;
    return packets ? WarpKernel::packet : WarpKernel::while_while;
}

/// Traces every launch of the kind by kernels that are like those of the rows, on the first
/// machine. Goes on with what `end` keeps.
void know_all_launches(const WarpTree& tree, const RayLaunches& launches, const Json& figures,
                       const SimulationEnd& end, const CommonOptions& common,
                       std::vector<SimulationRow>& rows) {
    std::vector<std::shared_ptr<LaunchTimes>> known;
    for (SimulationRow& row : rows) {
        const WarpKernel kernel = kernel_like(row.options.kernel);
        auto found = std::ranges::find(known, kernel, [](const auto& k) { return k->kernel; });
        if (found == known.end()) {
            known.push_back(std::make_shared<LaunchTimes>(LaunchTimes{kernel}));
            found = known.end() - 1;
        }
        row.all = *found;
    }
    std::vector<SimulateOptions> runs(known.size(), rows.front().options);
    for (std::size_t k = 0; k < runs.size(); ++k)
        runs[k].kernel = known[k]->kernel, runs[k].memory = false;
    if (end.state != nullptr) end.state->restore_times(figures, rows, known);
    Progress progress(fmt::format("all {} launches", rows.front().rays), common);
    launches.for_each(
        rows.front().kind,
        [&](const RayUnit& unit, double part) {
            for (SimulateOptions& run : runs) run.part_of_launch = unit.part;
            const std::vector<Simulation> found =
                simulate(tree, unit.rays, runs, nullptr, common.threads);
            for (std::size_t k = 0; k < runs.size(); ++k) {
                const double bound = simulated_rates(found[k], runs[k]).bound;
                known[k]->time.push_back(bound > 0 ? 1.0 / bound : 0.0);
                known[k]->rays.push_back(static_cast<double>(unit.rays.size()));
            }
            if (end.state != nullptr) end.state->keep_times(figures, rows, known);
            progress.show(part);
        },
        [](double) { return true; }, known.front()->time.size());
}

}  // namespace

Json asked_launches_json(const SceneTree& input, const RayLaunches& launches, RayKind kind,
                         const LaunchOptions& options) {
    Json asked =
        asked_rays_json(options.camera, chosen_size(options, input.scene), options.samples, kind);
    const bool secondary = kind != RayKind::primary;
    asked["ao_radius"] = kind == RayKind::ao ? Json(launches.ao_radius()) : Json(nullptr);
    asked["launch_rays"] = secondary ? Json(options.launch_rays) : Json(nullptr);
    return asked;
}

std::vector<SimulationRow> simulate_kind(const SceneTree& input, const WarpTree& tree,
                                         const RayLaunches& launches, RayKind kind,
                                         std::vector<SimulateOptions> runs,
                                         const LaunchOptions& options, const CommonOptions& common,
                                         const SimulationEnd& end) {
    std::vector<SimulationRow> rows;
    for (SimulateOptions& run : runs) {
        run.any_hit = kind == RayKind::ao;
        rows.push_back({.scene = input.scene.name,
                        .kind = kind,
                        .rays = std::string(ray_kind_name(kind)),
                        .options = run,
                        .sum = {},
                        .builder = std::string(builder_name(input.bvh.options().builder)),
                        .asked = asked_launches_json(input, launches, kind, options),
                        .sample = options.sample,
                        .units = {}});
    }
    Json figures;
    std::size_t done = 0;
    if (end.state != nullptr) {
        figures = figures_of(input, rows, options, common.seed);
        done = end.state->restore(figures, rows);
    }
    const std::size_t count = launches.count(kind);
    if (end.error >= 0 && done < count && count > least_launches)
        know_all_launches(tree, launches, figures, end, common, rows);
    Progress progress(fmt::format("simulating {}", ray_kind_name(kind)), common);
    const auto visit = [&](const RayUnit& unit, double part) {
        add_unit(tree, unit, runs, rows, common);
        if (end.state != nullptr) end.state->keep(figures, rows, ++done);
        progress.show(part);
    };
    const auto more = [&](double taken) {
        for (SimulationRow& row : rows) row.part_taken = taken;
        return !std::ranges::all_of(rows, [&](const SimulationRow& row) {
            const std::optional<double> error = row.sampling_error();
            return row.units.size() >= least_launches && error && *error <= end.error;
        });
    };
    const double taken = launches.for_each(kind, visit, more, done);
    for (SimulationRow& row : rows) row.part_taken = taken;
    return rows;
}

std::vector<SimulationRow> simulate_rays(const SceneTree& input, const WarpTree& tree,
                                         std::span<const Ray> rays, const std::string& name,
                                         std::vector<SimulateOptions> runs,
                                         const CommonOptions& common) {
    std::vector<SimulationRow> rows;
    for (const SimulateOptions& run : runs)
        rows.push_back({.scene = input.scene.name,
                        .kind = RayKind::primary,
                        .rays = name,
                        .options = run,
                        .sum = {},
                        .builder = std::string(builder_name(input.bvh.options().builder)),
                        .asked = asked_rays_json({}, {}, 0, std::nullopt),
                        .units = {}});
    add_unit(tree, {rays, 1.0}, runs, rows, common);
    const std::uint64_t invalid = count_invalid_rays(rays, common.threads);
    for (SimulationRow& row : rows) row.invalid_rays = invalid;
    return rows;
}

std::uint64_t count_invalid_rays(std::span<const Ray> rays, int threads) {
    std::vector<Hit> unused(rays.size());
    return trace(Bvh(), rays, unused, {.threads = threads}).invalid_rays;
}

namespace {

/// Rates, and per ray what they come from.
Json memory_limits_json(const SimulationRow& row) {
    if (row.sum.instructions == 0 || !row.has_memory()) return nullptr;
    Json limits = Json::object();
    for (const SimulatedRates::Limit& limit : row.rates().memory_limits)
        limits[std::string(limit.name)] = limit.mrays_per_s;
    const auto rays = static_cast<double>(row.sum.rays);
    limits["texture_fetches_per_ray"] = static_cast<double>(row.sum.texture_fetches) / rays;
    limits["l1_requests_per_ray"] = static_cast<double>(row.sum.l1_transactions) / rays;
    limits["replays_per_ray"] = static_cast<double>(row.sum.replays) / rays;
    limits["l2_bytes_per_ray"] = static_cast<double>(row.sum.l2_bytes) / rays;
    limits["dram_bytes_per_ray"] = static_cast<double>(row.sum.dram_bytes) / rays;
    limits["wait_clocks_per_ray"] = row.sum.memory_wait_clocks / rays;
    return limits;
}

}  // namespace

Json simulation_json(const SimulationRow& row) {
    const SimulatedRates rates = row.rates();
    const bool any = row.sum.instructions > 0;
    const auto rays = static_cast<double>(row.sum.rays);
    const std::optional<double> error = row.sampling_error();
    Json json{{"scene", row.scene},
              {"kernel", warp_kernel_name(row.options.kernel)},
              {"rays", row.rays},
              {"mode", row.options.any_hit ? "any" : "closest"},
              {"machine", row.options.machine.name},
              {"builder", row.builder},
              {"device", "sim"},
              {"simulated", true},
              {"width", row.options.width},
              {"count", row.sum.rays},
              {"launches", row.sum.launches},
              {"hits", row.sum.hits},
              {"different_hits", row.different_hits},
              {"invalid_rays", row.invalid_rays},
              {"mrays_per_s_bound", or_null(any, rates.bound)},
              {"mrays_per_s_scheduled", or_null(any && row.whole_launches, rates.scheduled)},
              {"mrays_per_s_single_warps", or_null(any && row.whole_launches, rates.single_warps)},
              {"mrays_per_s_free_blocks", or_null(any && row.whole_launches, rates.free_blocks)},
              {"mrays_per_s_memory", or_null(any && row.has_memory(), rates.memory)},
              {"memory_limit", any && row.has_memory() ? Json(rates.memory_limit) : Json(nullptr)},
              {"memory_limits", memory_limits_json(row)},
              {"simd_efficiency", or_null(any, rates.simd_efficiency)},
              {"issues_per_ray", or_null(any, static_cast<double>(row.sum.instructions) / rays)},
              {"instructions_per_ray",
               or_null(any, static_cast<double>(row.sum.lane_instructions) / rays)},
              {"idle_share", or_null(any && row.whole_launches && row.sum.issue_slots > 0,
                                     row.sum.idle_issues / row.sum.issue_slots)},
              {"sample", row.sample},
              {"part_taken", row.part_taken},
              {"sampling_error", error ? Json(*error) : Json(nullptr)},
              {"correction", row.correction()},
              {"operations", operations_json(row)},
              {"histogram", histogram_json(row.sum)}};
    json.update(row.asked);
    return json;
}

Json machine_model_json(const MachineModel& m) {
    Json costs = Json::array();
    for (const OperationCost& cost : m.costs) {
        costs.push_back({{"operation", cost.operation},
                         {"instructions", cost.instructions},
                         {"origin", cost.origin}});
        if (!cost.kernel.empty()) costs.back()["kernel"] = cost.kernel;
        if (cost.most > 0) costs.back()["most"] = cost.most;
        if (cost.half_rate > 0) costs.back()["half_rate"] = cost.half_rate;
    }
    return {{"name", m.name},
            {"origin", m.origin},
            {"multiprocessors", m.multiprocessors},
            {"clock_ghz", m.clock_ghz},
            {"lanes_per_clock", m.lanes_per_clock},
            {"warp_issue_clocks", m.warp_issue_clocks},
            {"read_clocks", m.read_clocks},
            {"stack_read_clocks", m.stack_read_clocks},
            {"resident_lanes", m.resident_lanes},
            {"block_lanes", m.block_lanes},
            {"registers", m.registers},
            {"shared_bytes", m.shared_bytes},
            {"l1_shared_bytes", m.l1_shared_bytes},
            {"block_release", block_release_name(m.block_release)},
            {"l1_transactions_per_clock", m.l1_transactions_per_clock},
            {"l1_bytes", m.l1_bytes},
            {"l2_gb_per_s", m.l2_gb_per_s},
            {"l2_bytes", m.l2_bytes},
            {"dram_gb_per_s", m.dram_gb_per_s},
            {"l1_line_bytes", m.l1_line_bytes},
            {"replays", m.replays},
            {"texture_bytes", m.texture_bytes},
            {"texture_sharers", m.texture_sharers},
            {"texture_fetches_per_clock", m.texture_fetches_per_clock},
            {"nodes_by_texture", m.nodes_by_texture},
            {"texture_clocks", m.texture_clocks},
            {"l1_clocks", m.l1_clocks},
            {"l2_clocks", m.l2_clocks},
            {"dram_clocks", m.dram_clocks},
            {"costs", costs}};
}

void print_simulation(const std::vector<SimulationRow>& rows) {
    if (rows.empty()) return;
    fmt::print("\n{} rays of {} on {}, width {}: simulated Mrays/s\n", rows.front().rays,
               rows.front().scene, rows.front().options.machine.name, rows.front().options.width);
    fmt::print("{:<36} {:>11} {:>9} {:>9} {:>17} {:>7} {:>8} {:>9} {:>7} {:>7}\n", "kernel", "rays",
               "bound", "scheduled", "memory", "SIMD", "issues", "instr", "idle", "error");
    for (const SimulationRow& row : rows) {
        const SimulatedRates rates = row.rates();
        const auto number = [](bool known, double value, int digits) {
            return known ? fmt::format("{:.{}f}", value, digits) : std::string("-");
        };
        const auto percent = [&](bool known, double part) {
            return known ? fmt::format("{:.1f}%", 100 * part) : std::string("-");
        };
        const bool any = row.sum.instructions > 0;
        const auto rays = static_cast<double>(row.sum.rays);
        const std::optional<double> error = row.sampling_error();
        fmt::print(
            "{:<36} {:>11} {:>9} {:>9} {:>17} {:>7} {:>8} {:>9} {:>7} {:>7}\n",
            warp_kernel_name(row.options.kernel), grouped(row.sum.rays),
            number(any, rates.bound, 1), number(any && row.whole_launches, rates.scheduled, 1),
            any && row.has_memory() ? fmt::format("{:.1f} {}", rates.memory, rates.memory_limit)
                                    : std::string("-"),
            percent(any, rates.simd_efficiency),
            number(any, static_cast<double>(row.sum.instructions) / rays, 1),
            number(any, static_cast<double>(row.sum.lane_instructions) / rays, 0),
            percent(any && row.whole_launches, row.sum.idle_issues / row.sum.issue_slots),
            percent(error.has_value(), error.value_or(0)));
        if (row.different_hits > 0)
            fmt::print("    {} hits differ from the scalar reference's\n",
                       grouped(row.different_hits));
    }
    print_invalid_rays(rows.front().invalid_rays);
}

void print_steps_to_scheduled(const std::vector<SimulationRow>& rows) {
    bool first = true;
    for (const SimulationRow& row : rows) {
        const SimulatedRates rates = row.rates();
        if (row.sum.instructions == 0 || !row.whole_launches) continue;
        if (first)
            fmt::print(
                "what takes {} from bound to scheduled, each on top of those before it\n{:<36} "
                "{:>16} {:>13} {:>17}\n",
                rows.front().options.machine.name, "kernel", "latency and tail", "whole blocks",
                "order of release");
        first = false;
        fmt::print("{:<36} {:>15.1f}% {:>12.1f}% {:>16.1f}%\n",
                   warp_kernel_name(row.options.kernel),
                   100 * (rates.single_warps / rates.bound - 1),
                   100 * (rates.free_blocks / rates.single_warps - 1),
                   100 * (rates.scheduled / rates.free_blocks - 1));
    }
}

MachineModel machine_from(const std::string& name_or_file) {
    if (name_or_file.ends_with(".json")) return load_machine_model(name_or_file);
    try {
        return machine_model(name_or_file);
    } catch (const InputError& error) {
        throw CLI::ValidationError("--machine", error.what() + std::string(", and .json files"));
    }
}

void check_machine(const std::string& name_or_file, std::span<const SimulateOptions> runs) {
    const auto check = [&] { static_cast<void>(simulate(WarpTree(Bvh{}), {}, runs)); };
    name_or_file.ends_with(".json") ? about(name_or_file, check) : check();
}

namespace {

/// The same work would be done twice.
void refuse_repeats(const std::string& names, const char* option) {
    std::vector<std::string> sorted = split(names);
    std::ranges::sort(sorted);
    const auto twice = std::ranges::adjacent_find(sorted);
    if (twice != sorted.end())
        throw CLI::ValidationError(option, "'" + *twice + "' is given twice");
}

}  // namespace

std::vector<WarpKernel> kernels_from(const std::string& names) {
    if (names == "all") return {warp_kernel_family().begin(), warp_kernel_family().end()};
    std::vector<WarpKernel> kernels;
    for (const std::string& name : split(names)) try {
            kernels.push_back(warp_kernel_from_name(name));
        } catch (const InputError& error) {
            throw CLI::ValidationError("--kernel", error.what());
        }
    refuse_repeats(names, "--kernel");
    return kernels;
}

WarpTree warp_tree_for(const Bvh& bvh, const std::vector<WarpKernel>& kernels) {
    return WarpTree(bvh, std::ranges::any_of(kernels, reads_wide_nodes));
}

std::vector<RayKind> kinds_from(const std::string& names) {
    const std::vector<RayKind> all{RayKind::primary, RayKind::ao, RayKind::diffuse,
                                   RayKind::diffuse_shuffled};
    if (names == "all") return all;
    std::vector<RayKind> kinds;
    for (const std::string& name : split(names)) {
        const auto kind = std::find_if(all.begin(), all.end(),
                                       [&](RayKind k) { return ray_kind_name(k) == name; });
        if (name.ends_with(".npy"))
            throw CLI::ValidationError("--rays", "'" + name +
                                                     "' is a file: simulate takes one alone, and "
                                                     "bench traversal makes its own rays");
        if (kind == all.end())
            throw CLI::ValidationError(
                "--rays", "'" + name + "' is not primary, ao, diffuse, diffuse_shuffled or all");
        kinds.push_back(*kind);
    }
    refuse_repeats(names, "--rays");
    return kinds;
}

}  // namespace raydix::cli
