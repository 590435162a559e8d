// Documents -> rows that can be put beside those of another document of the same command.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "report/fields.h"
#include "report/figure.h"

namespace raydix::report {

/// Names and values, in the order in which a page shows them. "": nothing is said.
using Settings = std::vector<std::pair<std::string, std::string>>;

struct Measure {
    enum class Better { lower, higher, neither };
    std::string name, unit;
    Better better = Better::neither;
    Origin origin = Origin::none;  // measured values vary from run to run, simulated ones by sample
    SpreadFields value;
    bool error_known = true;  // of a simulated figure: min to max is what the sample leaves open
    Settings work = {};       // what it depends on beside the work of its row
};

struct CompareRow {
    std::string key;  // equal keys belong together: the scene, the rays, the kernel, ...
    std::vector<Measure> measures;
    Settings work = {};  // what was done: figures of other work are not judged
};

/// Empty for commands whose documents have nothing to compare.
[[nodiscard]] std::vector<CompareRow> compare_rows(const Document& document);

/// Names of what both say, but not the same; "" if there are none.
[[nodiscard]] std::string what_differs(const Settings& a, const Settings& b);

}  // namespace raydix::report
