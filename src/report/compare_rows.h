// Documents -> rows that can be put beside those of another document of the same command.
#pragma once

#include <string>
#include <vector>

#include "report/fields.h"
#include "report/figure.h"

namespace raydix::report {

struct Measure {
    enum class Better { lower, higher, neither };
    std::string name, unit;
    Better better = Better::neither;
    Origin origin = Origin::none;  // measured values vary from run to run, simulated ones by sample
    SpreadFields value;
    bool error_known = true;  // of a simulated figure: min to max is what the sample leaves open
};

struct CompareRow {
    std::string key;  // equal keys belong together: the scene, the rays, the kernel, ...
    std::vector<Measure> measures;
};

/// Empty for commands whose documents have nothing to compare.
[[nodiscard]] std::vector<CompareRow> compare_rows(const Document& document);

/// Name and value of what a run was told and where it ran: machine, version, builder, bits, ...
[[nodiscard]] std::vector<std::pair<std::string, std::string>> settings_of(
    const Document& document);

}  // namespace raydix::report
