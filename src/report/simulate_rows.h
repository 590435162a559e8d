// The rows of `simulate` documents as plain structs, and how they go together.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "report/histogram_plot.h"
#include "report/sections.h"

namespace raydix::report {

struct SimulatedOperation {
    std::string name;
    std::optional<double> issues_per_ray, cost, efficiency, share;
};

/// One kernel with one kind of rays on one simulated machine.
struct SimulatedRow {
    std::string scene, kernel, rays, mode, machine, document;
    std::optional<double> width, count, hits;
    std::optional<double> bound, scheduled, memory;  // Mrays/s
    std::optional<double> efficiency, issues, instructions, idle, error, sample, part;
    std::vector<SimulatedOperation> operations = {};
    Histogram times = {};
    std::string unit = {};  // of the histogram
    std::string memory_limit = {};
};

[[nodiscard]] std::vector<SimulatedRow> simulated_rows(const Documents& documents);

/// Rows of one scene on one machine from one document.
struct SimulatedGroup {
    std::string scene, machine, document;
    std::optional<double> width;
    std::vector<SimulatedRow> rows;

    [[nodiscard]] std::string title() const;
    /// "primary" and so on, in the order of the rows; the mode behind it where a kind has several.
    [[nodiscard]] std::vector<std::string> ray_kinds() const;
    [[nodiscard]] std::vector<const SimulatedRow*> of_kind(const std::string& rays) const;
};

[[nodiscard]] std::vector<SimulatedGroup> simulated_groups(const std::vector<SimulatedRow>& rows);

}  // namespace raydix::report
