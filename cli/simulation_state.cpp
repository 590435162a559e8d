#include "simulation_state.h"

#include <fmt/format.h>
#include <raydix/error.h>
#include <raydix/files.h>
#include <raydix/version.h>
#define XXH_INLINE_ALL  // a shared raydix does not hand on the library it links
#include <xxhash.h>

#include <array>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <span>
#include <type_traits>
#include <utility>

#include "option_checks.h"

namespace raydix::cli {
namespace {

constexpr const char* kind_of_file = "state of bench traversal";

/// As long as it lives a signal that would end the process waits: half a file would be left beside
/// the one before. Signals that the caller's shell ignores stay ignored.
class EndsLater {
public:
    EndsLater() {
        noted = 0;
        for (std::size_t k = 0; k < signals.size(); ++k) {
            struct sigaction note {};
            note.sa_handler = [](int signal) { noted = signal; };
            sigaction(signals[k], nullptr, &before_[k]);
            if (before_[k].sa_handler == SIG_DFL) sigaction(signals[k], &note, nullptr);
        }
    }
    ~EndsLater() {
        for (std::size_t k = 0; k < signals.size(); ++k)
            sigaction(signals[k], &before_[k], nullptr);
        if (noted != 0) static_cast<void>(std::raise(noted));
    }
    EndsLater(const EndsLater&) = delete;
    EndsLater& operator=(const EndsLater&) = delete;

private:
    static constexpr std::array signals{SIGINT, SIGTERM, SIGHUP};
    static inline volatile std::sig_atomic_t noted = 0;
    std::array<struct sigaction, signals.size()> before_{};
};

/// Of what rays hit: a tree's hash knows boxes only.
std::string hash_of_triangles(const Bvh& bvh) {
    const auto bytes = std::as_bytes(bvh.triangles());
    return fmt::format("{:016x}", XXH3_64bits(bytes.data(), bytes.size()));
}

/// Calls field(name, member) for all numbers of a row that launches add to.
template <class Row, class Field>
void for_each_sum(Row& row, const Field& field) {
    auto& s = row.sum;
    field("rays", s.rays), field("launches", s.launches), field("hits", s.hits);
    field("instructions", s.instructions), field("lane_instructions", s.lane_instructions);
    field("scheduled_clocks", s.scheduled_clocks);
    field("single_warp_clocks", s.single_warp_clocks);
    field("free_block_clocks", s.free_block_clocks);
    field("idle_issues", s.idle_issues), field("issue_slots", s.issue_slots);
    field("texture_fetches", s.texture_fetches), field("l1_transactions", s.l1_transactions);
    field("l2_bytes", s.l2_bytes), field("dram_bytes", s.dram_bytes), field("replays", s.replays);
    field("memory_wait_clocks", s.memory_wait_clocks);
    field("whole_launches", row.whole_launches), field("different_hits", row.different_hits);
}

Json row_json(const SimulationRow& row) {
    Json out = Json::object();
    for_each_sum(row, [&](const char* name, const auto& value) { out[name] = value; });
    Json operations = Json::array(), times = Json::array(), units = Json::array();
    for (const OperationFigure& op : row.sum.operations)
        operations.push_back({op.issues, op.lanes});
    for (std::size_t k = 0; k < row.sum.warp_times.size(); ++k)
        if (row.sum.warp_times[k] != 0) times.push_back({k, row.sum.warp_times[k]});
    for (const SimulatedRates& unit : row.units)
        units.push_back({unit.bound, unit.scheduled, unit.single_warps, unit.free_blocks});
    out["operations"] = operations, out["warp_times"] = times, out["units"] = units;
    return out;
}

/// As written: no count is negative or has a fraction.
template <class T>
void take(const Json& from, T& value) {
    if (std::is_integral_v<T> && !std::is_same_v<T, bool> && !from.is_number_unsigned())
        throw InputError(from.dump() + " is no count");
    from.get_to(value);
}

bool says(const Json& object, const char* field, std::string_view text) {
    return object.contains(field) && object[field].is_string() &&
           object[field].get<std::string>() == text;
}

/// In UTF-8, whatever the file's name is in: JSON holds nothing else.
std::string part_name(const std::vector<SimulationRow>& rows) {
    const Json name =
        fmt::format("{}, {}, {}", rows.front().scene, rows.front().builder, rows.front().rays);
    return Json::parse(name.dump(-1, ' ', false, Json::error_handler_t::replace));
}

void read_row(const Json& from, std::uint64_t launches, SimulationRow& row) {
    row.sum = simulate(WarpTree(Bvh{}), {}, std::span(&row.options, 1)).front();  // names and costs
    for_each_sum(row, [&](const char* name, auto& value) { take(from.at(name), value); });
    if (row.sum.launches != launches)
        throw InputError(
            fmt::format("the sums are of {} launches, not of {}", row.sum.launches, launches));
    const Json& operations = from.at("operations");
    for (std::size_t k = 0; k < row.sum.operations.size(); ++k) {
        take(operations.at(k).at(0), row.sum.operations[k].issues);
        take(operations.at(k).at(1), row.sum.operations[k].lanes);
    }
    for (const Json& bin : from.at("warp_times")) {
        std::size_t k = 0;
        take(bin.at(0), k);
        take(bin.at(1), row.sum.warp_times.at(k));
    }
    for (const Json& unit : from.at("units"))
        row.units.push_back({.bound = unit.at(0).get<double>(),
                             .scheduled = unit.at(1).get<double>(),
                             .single_warps = unit.at(2).get<double>(),
                             .free_blocks = unit.at(3).get<double>()});
}

}  // namespace

Json figures_of(const SceneTree& input, const std::vector<SimulationRow>& rows,
                const LaunchOptions& launches, std::uint64_t seed) {
    Json cameras = Json::array(), runs = Json::array();
    for (const Camera& c : input.scene.cameras.cameras)
        cameras.push_back({c.position.x, c.position.y, c.position.z, c.target.x, c.target.y,
                           c.target.z, c.up.x, c.up.y, c.up.z, c.vfov});
    for (const SimulationRow& row : rows)
        runs.push_back({warp_kernel_name(row.options.kernel), row.options.width, row.options.memory,
                        machine_model_json(row.options.machine)});
    const Size size = chosen_size(launches, input.scene);
    return {{"tree", tree_hash(input.bvh)},
            {"triangles", hash_of_triangles(input.bvh)},
            {"cameras", cameras},
            {"camera", launches.camera},
            {"size", {size.width, size.height}},
            {"samples", launches.samples},
            {"ao_radius", chosen_ao_radius(launches.ao_radius, input.scene, input.bvh.bounds())},
            {"sample", launches.sample},
            {"launch_rays", launches.launch_rays},
            {"seed", seed},
            {"runs", runs}};
}

SimulationState::SimulationState(std::string file) : file_(std::move(file)) {
    document_ = {{"holds", kind_of_file}, {"version", version}, {"parts", Json::object()}};
    require_writable(file_);
    if (!std::filesystem::exists(file_)) return;
    std::ifstream in(file_);
    const Json found = Json::parse(in, nullptr, false);
    if (!found.is_object() || !says(found, "holds", kind_of_file) || !found.contains("parts") ||
        !found["parts"].is_object())
        throw InputError(file_ + ": is no " + kind_of_file);
    if (!says(found, "version", version))
        throw InputError(file_ + ": comes from another version of raydix");
    document_ = found;
}

const Json* SimulationState::part_of(const Json& figures,
                                     const std::vector<SimulationRow>& rows) const {
    const std::string name = part_name(rows);
    const auto part = document_["parts"].find(name);
    if (part == document_["parts"].end()) return nullptr;
    if (!part->is_object() || part->value("of", Json()) != figures)
        throw InputError(file_ + ": '" + name +
                         "' was counted with another scene, or with other options, cameras or "
                         "machines");
    return &*part;
}

std::size_t SimulationState::restore(const Json& figures, std::vector<SimulationRow>& rows) const {
    const Json* const part = part_of(figures, rows);
    if (part == nullptr || !part->contains("rows")) return 0;
    std::vector<SimulationRow> read = rows;
    try {
        const Json& kept = part->at("rows");
        std::size_t launches = 0;
        take(part->at("launches"), launches);
        if (kept.size() != read.size())
            throw InputError(fmt::format("{} rows, not {}", kept.size(), read.size()));
        for (std::size_t k = 0; k < read.size(); ++k) read_row(kept[k], launches, read[k]);
        rows = std::move(read);
        return launches;
    } catch (const std::exception& error) {
        throw InputError(file_ + ": '" + part_name(rows) +
                         "' cannot be gone on with: " + error.what());
    }
}

void SimulationState::restore_times(const Json& figures, const std::vector<SimulationRow>& rows,
                                    AllTimes times) const {
    const Json* const part = part_of(figures, rows);
    if (part == nullptr || !part->contains("all")) return;
    try {
        for (const auto& known : times) {
            LaunchTimes read{known->kernel};
            for (const Json& launch : part->at("all").at(warp_kernel_name(known->kernel)))
                read.time.push_back(launch.at(0).get<double>()),
                    read.rays.push_back(launch.at(1).get<double>());
            if (read.time.size() != part->at("all").front().size())
                throw InputError("kernels with different numbers of launches");
            *known = std::move(read);
        }
    } catch (const std::exception& error) {
        throw InputError(file_ + ": '" + part_name(rows) +
                         "' cannot be gone on with: " + error.what());
    }
}

void SimulationState::keep_times(const Json& figures, const std::vector<SimulationRow>& rows,
                                 AllTimes times) {
    Json kept = Json::object();
    for (const auto& known : times) {
        Json& launches = kept[std::string(warp_kernel_name(known->kernel))] = Json::array();
        for (std::size_t k = 0; k < known->time.size(); ++k)
            launches.push_back({known->time[k], known->rays[k]});
    }
    Json& part = document_["parts"][part_name(rows)];
    part["of"] = figures, part["all"] = kept;
    write();
}

void SimulationState::keep(const Json& figures, const std::vector<SimulationRow>& rows,
                           std::size_t launches) {
    Json kept = Json::array();
    for (const SimulationRow& row : rows) kept.push_back(row_json(row));
    Json& part = document_["parts"][part_name(rows)];
    part["of"] = figures, part["launches"] = launches, part["rows"] = kept;
    write();
}

void SimulationState::write() const {
    const std::string text = document_.dump() + "\n";
    const EndsLater ends_later;
    write_file(file_, std::as_bytes(std::span(text)));
}

}  // namespace raydix::cli
