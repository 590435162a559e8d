#include "traversal_ranking.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <string>

#include "ratio_error.h"

namespace raydix::cli {
namespace {

using Group = std::vector<const SimulationRow*>;

/// Rows over the same rays on the same machine, in the order of their first ones.
std::vector<Group> groups_of(const std::vector<SimulationRow>& rows) {
    const auto same = [](const SimulationRow& a, const SimulationRow& b) {
        return a.scene == b.scene && a.rays == b.rays &&
               a.options.machine.name == b.options.machine.name;
    };
    std::vector<Group> groups;
    for (const SimulationRow& row : rows) {
        if (row.sum.instructions == 0) continue;
        const auto found = std::ranges::find_if(
            groups, [&](const Group& group) { return same(*group.front(), row); });
        if (found == groups.end())
            groups.push_back({&row});
        else
            found->push_back(&row);
    }
    std::erase_if(groups, [](const Group& group) { return group.size() < 2; });
    return groups;
}

Json ranked_json(const SimulationRow& row, const SimulationRow& first) {
    const SimulatedRates::Limit limit = row.tightest();
    Json out{{"kernel", warp_kernel_name(row.options.kernel)},
             {"mrays_per_s", limit.mrays_per_s},
             {"limit", limit.name},
             {"first_over_it", 1.0},
             {"low", nullptr},
             {"high", nullptr},
             {"behind", nullptr},
             {"needs", ""}};
    if (&row == &first) return out;
    const RatioFound found = ratio_of(first, row, Figure::tightest);
    out["first_over_it"] = *found.ratio;
    out["needs"] = found.needs;
    if (!found.needs.empty()) return out;
    out["low"] = found.error.low, out["high"] = found.error.high;
    out["behind"] = found.error.low > 1.0;
    return out;
}

}  // namespace

Json traversal_ranking(const std::vector<SimulationRow>& rows) {
    Json out = Json::array();
    for (Group& group : groups_of(rows)) {
        std::ranges::stable_sort(group, std::greater(), [](const SimulationRow* row) {
            return row->tightest().mrays_per_s;
        });
        const SimulationRow& first = *group.front();
        Json kernels = Json::array();
        for (const SimulationRow* row : group) kernels.push_back(ranked_json(*row, first));
        out.push_back({{"scene", first.scene},
                       {"machine", first.options.machine.name},
                       {"rays", first.rays},
                       {"kernels", kernels}});
    }
    return out;
}

void print_ranking(const Json& ranking) {
    if (ranking.empty()) return;
    fmt::print(
        "\nhighest of the tightest limits, simulated, and the kernels that are not told from it: "
        "by how much\nit is above them, with the error of the sample and of the costs\n");
    for (const Json& row : ranking) {
        const Json& first = row["kernels"][0];
        std::vector<std::string> level;
        for (const Json& kernel : row["kernels"]) {
            if (&kernel == &first || kernel["behind"] == true) continue;
            level.push_back(kernel["kernel"].get<std::string>() +
                            (kernel["low"].is_null()
                                 ? fmt::format(" ({})", kernel["needs"].get<std::string>())
                                 : fmt::format(" ({:.2f} to {:.2f})", kernel["low"].get<double>(),
                                               kernel["high"].get<double>())));
        }
        fmt::print("{:<12} {:<8} {:<17} {} {:.1f} Mrays/s ({}){}\n",
                   row["scene"].get<std::string>(), row["machine"].get<std::string>(),
                   row["rays"].get<std::string>(), first["kernel"].get<std::string>(),
                   first["mrays_per_s"].get<double>(), first["limit"].get<std::string>(),
                   level.empty() ? "" : fmt::format("; not told from: {}", fmt::join(level, ", ")));
    }
}

}  // namespace raydix::cli
