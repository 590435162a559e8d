#include "report/simulate_rows.h"

#include <fmt/format.h>

#include <algorithm>

namespace raydix::report {
namespace {

SimulatedRow row_of(const Document& document, const Json& r) {
    SimulatedRow row{.scene = text_at(r, "scene"),
                     .kernel = text_at(r, "kernel"),
                     .rays = text_at(r, "rays"),
                     .mode = text_at(r, "mode"),
                     .machine = text_at(r, "machine"),
                     .document = document.name,
                     .width = number_at(r, "width"),
                     .count = number_at(r, "count"),
                     .hits = number_at(r, "hits"),
                     .bound = spread_at(r, "mrays_per_s_bound").median,
                     .scheduled = spread_at(r, "mrays_per_s_scheduled").median,
                     .memory = spread_at(r, "mrays_per_s_memory").median,
                     .efficiency = number_at(r, "simd_efficiency"),
                     .issues = number_at(r, "issues_per_ray"),
                     .instructions = number_at(r, "instructions_per_ray"),
                     .idle = number_at(r, "idle_share"),
                     .error = number_at(r, "sampling_error"),
                     .sample = number_at(r, "sample"),
                     .part = number_at(r, "part_taken"),
                     .unit = text_at(r, "histogram.unit"),
                     .memory_limit = text_at(r, "memory_limit")};
    if (row.scene.empty()) row.scene = scene_name(at(r, "scene").is_object() ? r : document.root);
    for (std::string* name : {&row.kernel, &row.rays, &row.machine})
        if (name->empty()) *name = "without a name";
    for (const Json* op : objects_at(r, "operations"))
        row.operations.push_back({text_at(*op, "name"), number_at(*op, "issues_per_ray"),
                                  number_at(*op, "cost"), number_at(*op, "simd_efficiency"),
                                  number_at(*op, "share")});
    row.times = {row.kernel, numbers_at(r, "histogram.edges"), numbers_at(r, "histogram.counts"),
                 0};
    return row;
}

}  // namespace

std::vector<SimulatedRow> simulated_rows(const Documents& documents) {
    std::vector<SimulatedRow> rows;
    for (const Document& document : documents)
        for (const Json* row : objects_at(document.root, "simulate"))
            rows.push_back(row_of(document, *row));
    return rows;
}

std::string SimulatedGroup::title() const {
    return scene + " on " + machine + (width ? fmt::format(", {:.0f} lanes a warp", *width) : "");
}

std::vector<std::string> SimulatedGroup::ray_kinds() const {
    std::vector<std::string> kinds;
    for (const SimulatedRow& row : rows)
        if (std::ranges::find(kinds, row.rays) == kinds.end()) kinds.push_back(row.rays);
    return kinds;
}

std::vector<const SimulatedRow*> SimulatedGroup::of_kind(const std::string& rays) const {
    std::vector<const SimulatedRow*> some;
    for (const SimulatedRow& row : rows)
        if (row.rays == rays) some.push_back(&row);
    return some;
}

std::vector<SimulatedGroup> simulated_groups(const std::vector<SimulatedRow>& rows) {
    std::vector<SimulatedGroup> groups;
    for (const SimulatedRow& row : rows) {
        const auto found = std::ranges::find_if(groups, [&](const SimulatedGroup& group) {
            return group.scene == row.scene && group.machine == row.machine &&
                   group.document == row.document && group.width == row.width;
        });
        if (found == groups.end())
            groups.push_back({row.scene, row.machine, row.document, row.width, {row}});
        else
            found->rows.push_back(row);
    }
    return groups;
}

}  // namespace raydix::report
