// What the files of `raydix bench hierarchy` share: its options, the rows it has studied, and the
// parts of its document.
#pragma once

#include <fmt/format.h>
#include <raydix/hierarchy_study.h>

#include <cmath>
#include <string>
#include <vector>

#include "output.h"

namespace raydix::cli {

struct HierarchyBench {
    CommonOptions common;
    std::vector<std::string> scenes;  // none: the dragon, where its file is at hand, and figures
    std::vector<std::uint64_t> sizes{1000, 10'000, 100'000, 1'000'000};
    std::vector<std::uint32_t> cost_sizes{2'000, 8'000, 32'000, 125'000, 500'000, 2'000'000};
    std::vector<int> thread_counts;
    std::vector<std::string> subjects;  // none: all
    std::vector<double> factors{1, 2, 4, 8, 16, 32, 64};
    std::vector<int> bits{30};
    int max_leaf = 1, repeat = 5;
};

/// As tables show a figure; a dash where there is none.
[[nodiscard]] inline std::string or_dash(double value, int digits, const char* unit = "") {
    return std::isfinite(value) ? fmt::format("{:.{}f}{}", value, digits, unit) : "-";
}

/// As documents hold a figure; null where there is none.
[[nodiscard]] inline Json finite(double value) {
    return std::isfinite(value) ? Json(value) : Json(nullptr);
}

/// A run and where it comes from.
struct StudiedRow {
    std::string scene;
    bool size_series = false;
    HierarchyRun run;
};

/// The claims of Karras 2012, judged by one rule (hierarchy_claims.cpp). `costs`: of these bits.
[[nodiscard]] Json hierarchy_claims(const std::vector<StudiedRow>& rows, const MeasuredCosts& costs,
                                    int bits);
void print_hierarchy_claims(const Json& claims);

[[nodiscard]] Json whole_builds(const HierarchyBench& options, const Model& scene, int bits,
                                const std::vector<int>& thread_counts);

}  // namespace raydix::cli
