// docs/costs-by-operation.md: what each operation of each kernel compiles to, and what it takes on
// each machine. The page is made here.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "simt/cost_model.h"
#include "simt/derived_costs.h"
#include "simt/op.h"
#include "support/support.h"

namespace raydix::test {
namespace {

struct Counted {
    std::string kernel, operation;
    std::uint32_t places;
    std::array<std::uint32_t, kind_count> of;
};

#define RAYDIX_SM90_KINDS(kernel, op, places, ...) {kernel, #op, places, {__VA_ARGS__}},
const std::vector<Counted> counted{
#include "simt/sm90_kinds.inc"
};
#undef RAYDIX_SM90_KINDS

std::string kinds_of(const Counted& row) {
    std::string text;
    for (std::size_t kind = 0; kind < kind_count; ++kind)
        if (row.of[kind] != 0)
            text += (text.empty() ? "" : ", ") + std::to_string(row.of[kind]) + " " +
                    std::string(instruction_kind_names()[kind]);
    return row.places == 1 ? text : text + "; at " + std::to_string(row.places) + " places";
}

std::string cost_on(const std::vector<OperationCost>& costs, const Counted& row) {
    const auto found = std::find_if(costs.begin(), costs.end(), [&](const OperationCost& c) {
        return c.kernel == row.kernel && c.operation == row.operation;
    });
    if (found == costs.end()) return "missing";
    const std::string least = std::to_string(found->instructions);
    return found->most <= found->instructions ? least
                                              : least + " to " + std::to_string(found->most);
}

/// One row for all kernels that have the same.
std::string table() {
    const std::vector<OperationCost> machines[] = {gt200_costs(), gt200_enum_popc_costs(),
                                                   fermi_costs(), kepler_costs()};
    std::map<std::size_t, std::vector<std::pair<std::string, std::string>>> rows;
    for (const Counted& row : counted) {
        std::string cells = " | " + kinds_of(row);
        for (const auto& costs : machines) cells += " | " + cost_on(costs, row);
        const auto place = std::size_t(std::find(op_names.begin(), op_names.end(), row.operation) -
                                       op_names.begin());
        auto& same_operation = rows[place];
        const auto same = std::find_if(same_operation.begin(), same_operation.end(),
                                       [&](const auto& r) { return r.second == cells; });
        const std::string kernel = "`" + row.kernel + "`";
        if (same == same_operation.end())
            same_operation.push_back({kernel, cells});
        else
            same->first += ", " + kernel;
    }
    std::string text =
        "| operation | kernels | sm_90 instructions | GT200 | with ENUM, POPC | Fermi | Kepler |\n"
        "| --- | --- | --- | --- | --- | --- | --- |\n";
    for (const auto& [place, same_operation] : rows)
        for (const auto& [kernels, cells] : same_operation)
            text += "| `" + std::string(op_names[place]) + "` | " + kernels + cells + " |\n";
    return text;
}

/// RAYDIX_UPDATE_DOCS=1 writes the page's table anew.
TEST(CostTable, OfThePageIsWhatTheSimulatorCharges) {
    const auto path = source_file("docs/costs-by-operation.md");
    std::stringstream content;
    content << std::ifstream(path).rdbuf();
    std::string page = content.str();
    const std::string start = "<!-- operations -->\n", end = "<!-- end -->";
    const std::size_t from = page.find(start), to = page.find(end);
    ASSERT_TRUE(from != std::string::npos && to != std::string::npos) << path;
    const std::size_t first = from + start.size();
    const char* const update = std::getenv("RAYDIX_UPDATE_DOCS");
    if (update && std::string_view(update) == "1") {
        page.replace(first, to - first, table());
        std::ofstream(path) << page;
        return;
    }
    EXPECT_EQ(page.substr(first, to - first), table()) << "run with RAYDIX_UPDATE_DOCS=1";
}

TEST(CostTable, NamesEveryOperationThatKernelsHave) {
    const std::string text = table();
    EXPECT_EQ(text.find("missing"), std::string::npos);
    for (const Counted& row : counted) {
        EXPECT_NE(text.find("| `" + row.operation + "` |"), std::string::npos) << row.operation;
        EXPECT_NE(text.find("`" + row.kernel + "`"), std::string::npos) << row.kernel;
    }
}

}  // namespace
}  // namespace raydix::test
