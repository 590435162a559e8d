#include "traversal_claims.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <string>

#include "paper_claims.h"
#include "published.h"

namespace raydix::cli {
namespace {

const SimulationRow* find_row(const std::vector<SimulationRow>& rows, const std::string& scene,
                              WarpKernel kernel, RayKind kind, std::string_view machine) {
    const auto found = std::find_if(rows.begin(), rows.end(), [&](const SimulationRow& row) {
        return row.scene == scene && row.options.kernel == kernel && row.kind == kind &&
               row.options.machine.name == machine && row.options.width == 32;
    });
    return found == rows.end() ? nullptr : &*found;
}

/// What the authors' own rates on this scene give, where they published both kernels.
std::optional<double> published_ratio(const Claim& claim, std::string scene) {
    if (claim.figure != Figure::bound || std::string_view(claim.machine) != claim.machine_against)
        return std::nullopt;
    for (char& c : scene) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    const auto rate = [&](WarpKernel kernel) -> std::optional<double> {
        for (const PublishedRates& row : published_rates)
            if (scene.find(row.scene) != std::string::npos && row.machine == claim.machine &&
                row.kernel == warp_kernel_name(kernel))
                return row.mrays_per_s[claim.kind == RayKind::primary ? 0
                                       : claim.kind == RayKind::ao    ? 1
                                                                      : 2];
        return std::nullopt;
    };
    const auto a = rate(claim.kernel), b = rate(claim.against);
    return a && b ? std::optional(*a / *b) : std::nullopt;
}

std::string found_text(const Claim& claim, const RatioFound& found) {
    const bool other = std::string_view(claim.machine) != claim.machine_against;
    const std::string about =
        fmt::format("{}{} against {}, {} rays, {}, simulated", warp_kernel_name(claim.kernel),
                    other ? fmt::format(" on {}", claim.machine) : "",
                    warp_kernel_name(claim.against), ray_kind_name(claim.kind),
                    claim.figure == Figure::bound          ? "issue bound"
                    : claim.figure == Figure::scheduled    ? "scheduled"
                    : claim.figure == Figure::instructions ? "instructions a ray"
                                                           : "time of the slowest 0.1 % of warps");
    if (!found.ratio) return found.needs + " (" + about + ")";
    const std::string error =
        found.needs.empty() ? fmt::format(", {:.2f} to {:.2f}", found.error.low, found.error.high)
                            : ", error: " + found.needs;
    return fmt::format("{:.2f} times{} ({})", *found.ratio, error, about);
}

/// Whether the ratio lies in the paper's interval, if that is the same all over its error.
std::optional<bool> verdict(const Interval& paper, const RatioFound& found) {
    if (!found.ratio || !found.needs.empty()) return std::nullopt;
    if (found.error.low >= paper.low && found.error.high <= paper.high) return true;
    if (found.error.high < paper.low || found.error.low > paper.high) return false;
    return std::nullopt;
}

Json or_null(std::optional<double> value) {
    return value && std::isfinite(*value) ? Json(*value) : Json(nullptr);
}

Json claim_json(const Claim& claim, const std::string& scene, const RatioFound& found) {
    const std::optional<bool> holds = verdict(claim.ratio, found);
    const bool known = found.ratio && found.needs.empty();
    const std::optional<double> published = published_ratio(claim, scene);
    return {{"claim", claim.text},
            {"paper",
             claim.paper +
                 (published ? fmt::format("; its rates on this scene: {:.2f}", *published) : "")},
            {"paper_low", claim.ratio.low},
            {"paper_high", or_null(claim.ratio.high)},
            {"published", or_null(published)},
            {"found", found_text(claim, found)},
            {"ratio", or_null(found.ratio)},
            {"low", known ? Json(found.error.low) : Json(nullptr)},
            {"high", known ? Json(found.error.high) : Json(nullptr)},
            {"scene", scene},
            {"verdict", !found.needs.empty() ? found.needs
                        : !holds             ? "open"
                        : *holds             ? "holds"
                                             : "does not hold"},
            {"holds", holds ? Json(*holds) : Json(nullptr)}};
}

}  // namespace

Json traversal_claims(const std::vector<SimulationRow>& rows) {
    std::vector<std::string> scenes;
    for (const SimulationRow& row : rows)
        if (std::find(scenes.begin(), scenes.end(), row.scene) == scenes.end())
            scenes.push_back(row.scene);
    Json found = Json::array();
    for (const std::string& scene : scenes)
        for (const Claim& claim : paper_claims::all) {
            const SimulationRow* a = find_row(rows, scene, claim.kernel, claim.kind, claim.machine);
            const SimulationRow* b =
                find_row(rows, scene, claim.against, claim.kind, claim.machine_against);
            if (a != nullptr && b != nullptr)
                found.push_back(claim_json(claim, scene, ratio_of(*a, *b, claim.figure)));
        }
    return found;
}

void print_claims(const Json& claims_found) {
    if (claims_found.empty()) return;
    fmt::print(
        "\nclaims of Aila and Laine 2009; found: all simulated, with the error of the sample and "
        "of the costs.\nA claim holds if all of that lies in the paper's interval, and does not "
        "if none of it does; else it is open\n");
    for (const Json& row : claims_found) {
        const Json& high = row["paper_high"];
        fmt::print("{:<20} {:<12} {}\n     paper {} ({:.2f} to {}); found {}\n",
                   row["verdict"].get<std::string>(), row["scene"].get<std::string>(),
                   row["claim"].get<std::string>(), row["paper"].get<std::string>(),
                   row["paper_low"].get<double>(),
                   high.is_null() ? "any" : fmt::format("{:.2f}", high.get<double>()),
                   row["found"].get<std::string>());
    }
}

}  // namespace raydix::cli
