// Claims as data: two kernels, a kind of ray, a machine, and the ratio that the paper gives.
#include "traversal_claims.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

namespace raydix::cli {
namespace {

enum class Figure { bound, scheduled, instructions, slowest_warps };

struct Claim {
    const char* text;
    const char* paper;
    WarpKernel kernel, against;
    RayKind kind;
    const char *machine, *machine_against;
    Figure figure;
    double ratio;  // of `kernel` to `against`, as the paper has it
};

constexpr const char* per_ray_text = "per-ray kernels beat packets, about twofold on diffuse rays";
constexpr const char* replacement_text = "replacing terminated rays would gain about 20 %";
constexpr const char* queue_text = "local work queues would gain about 40 % (ao), 80 % (diffuse)";
constexpr const char* queue_paper = "predicted by the authors' simulator, on Fairy";
constexpr const char* predicted = "predicted by the authors' simulator";

using K = WarpKernel;
using R = RayKind;
constexpr const char *old = "gtx285", *wished = "gtx285_enum_popc";

constexpr Claim claims[] = {
    {per_ray_text, "measured", K::persistent_while_while, K::persistent_packet, R::diffuse, old,
     old, Figure::bound, 2.0},
    {per_ray_text, "measured", K::persistent_while_while, K::persistent_packet, R::ao, old, old,
     Figure::bound, 1.3},
    {"persistent warps gain about twofold for packets", "measured", K::persistent_packet, K::packet,
     R::primary, old, old, Figure::scheduled, 2.0},
    {"persistent warps gain about 1.5 times for while-while", "measured", K::persistent_while_while,
     K::while_while, R::primary, old, old, Figure::scheduled, 1.5},
    {"persistent warps gain about 1.5 times for while-while", "measured", K::persistent_while_while,
     K::while_while, R::diffuse, old, old, Figure::scheduled, 1.5},
    {"if-if issues more instructions than while-while", "simulated", K::if_if, K::while_while,
     R::primary, old, old, Figure::instructions, 1.2},
    {"the slowest warps of if-if are about 30 % faster", "simulated", K::while_while, K::if_if,
     R::diffuse, old, old, Figure::slowest_warps, 1.3},
    {"speculation gains 5 to 10 % on primary rays", "measured",
     K::persistent_speculative_while_while, K::persistent_while_while, R::primary, old, old,
     Figure::bound, 1.05},
    {"speculation gains 5 to 10 % on ao rays", "measured", K::persistent_speculative_while_while,
     K::persistent_while_while, R::ao, old, old, Figure::bound, 1.05},
    {replacement_text, predicted, K::ray_replacement, K::persistent_while_while, R::ao, old, old,
     Figure::bound, 1.2},
    {replacement_text, predicted, K::ray_replacement, K::persistent_while_while, R::ao, wished, old,
     Figure::bound, 1.2},
    {replacement_text, predicted, K::ray_replacement, K::persistent_while_while, R::diffuse, old,
     old, Figure::bound, 1.2},
    {replacement_text, predicted, K::ray_replacement, K::persistent_while_while, R::diffuse, wished,
     old, Figure::bound, 1.2},
    {queue_text, queue_paper, K::work_queue, K::persistent_while_while, R::ao, old, old,
     Figure::bound, 1.4},
    {queue_text, queue_paper, K::work_queue, K::persistent_while_while, R::ao, wished, old,
     Figure::bound, 1.4},
    {queue_text, queue_paper, K::work_queue, K::persistent_while_while, R::diffuse, old, old,
     Figure::bound, 1.8},
    {queue_text, queue_paper, K::work_queue, K::persistent_while_while, R::diffuse, wished, old,
     Figure::bound, 1.8},
};

/// Least time of the slowest 0.1 % of the warps, in instructions.
double slowest_warps(const Simulation& sum) {
    std::uint64_t all = 0;
    for (const std::uint64_t count : sum.warp_times) all += count;
    std::uint64_t seen = 0;
    for (std::size_t k = sum.warp_times.size(); k-- > 0;) {
        seen += sum.warp_times[k];
        if (seen > 0 && seen * 1000 >= all) return std::exp2(static_cast<double>(k) / 8.0);
    }
    return 0.0;
}

std::optional<double> value_of(const SimulationRow& row, Figure figure) {
    if (row.sum.instructions == 0) return std::nullopt;
    const SimulatedRates rates = row.rates();
    switch (figure) {
        case Figure::bound:
            return rates.bound;
        case Figure::scheduled:
            return row.whole_launches ? std::optional(rates.scheduled) : std::nullopt;
        case Figure::instructions:
            return static_cast<double>(row.sum.instructions) / static_cast<double>(row.sum.rays);
        default:
            return slowest_warps(row.sum);
    }
}

const SimulationRow* find_row(const std::vector<SimulationRow>& rows, const std::string& scene,
                              WarpKernel kernel, RayKind kind, std::string_view machine) {
    const auto found = std::find_if(rows.begin(), rows.end(), [&](const SimulationRow& row) {
        return row.scene == scene && row.options.kernel == kernel && row.kind == kind &&
               row.options.machine.name == machine && row.options.width == 32;
    });
    return found == rows.end() ? nullptr : &*found;
}

std::string found_text(const Claim& claim, double ratio) {
    const bool other = std::string_view(claim.machine) != claim.machine_against;
    return fmt::format(
        "{:.2f} times ({}{} against {}, {} rays, {}, simulated)", ratio,
        warp_kernel_name(claim.kernel), other ? fmt::format(" on {}", claim.machine) : "",
        warp_kernel_name(claim.against), ray_kind_name(claim.kind),
        claim.figure == Figure::bound          ? "issue bound"
        : claim.figure == Figure::scheduled    ? "scheduled"
        : claim.figure == Figure::instructions ? "instructions a ray"
                                               : "time of the slowest 0.1 % of warps");
}

}  // namespace

Json traversal_claims(const std::vector<SimulationRow>& rows) {
    std::vector<std::string> scenes;
    for (const SimulationRow& row : rows)
        if (std::find(scenes.begin(), scenes.end(), row.scene) == scenes.end())
            scenes.push_back(row.scene);
    Json found = Json::array();
    for (const std::string& scene : scenes)
        for (const Claim& claim : claims) {
            const SimulationRow* a = find_row(rows, scene, claim.kernel, claim.kind, claim.machine);
            const SimulationRow* b =
                find_row(rows, scene, claim.against, claim.kind, claim.machine_against);
            if (a == nullptr || b == nullptr) continue;
            const auto x = value_of(*a, claim.figure), y = value_of(*b, claim.figure);
            if (!x || !y || *y <= 0) continue;
            const double ratio = *x / *y;
            found.push_back({{"claim", claim.text},
                             {"paper", fmt::format("{:g} times, {}", claim.ratio, claim.paper)},
                             {"found", found_text(claim, ratio)},
                             {"ratio", ratio},
                             {"scene", scene},
                             {"holds", ratio >= 1.0 + 0.5 * (claim.ratio - 1.0)}});
        }
    return found;
}

void print_claims(const Json& claims_found) {
    if (claims_found.empty()) return;
    fmt::print(
        "\nclaims of Aila and Laine 2009 (a gain holds if half of it is found; all simulated)\n");
    for (const Json& row : claims_found)
        fmt::print("{:<4} {:<14} {}\n     paper {}; found {}\n",
                   row["holds"].get<bool>() ? "yes" : "no", row["scene"].get<std::string>(),
                   row["claim"].get<std::string>(), row["paper"].get<std::string>(),
                   row["found"].get<std::string>());
}

}  // namespace raydix::cli
