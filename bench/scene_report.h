// Figures of `bench scene` -> JSON, tables, and what the ratios are over all scenes.
#pragma once

#include <vector>

#include "cli/output.h"
#include "scene_contest.h"

namespace raydix::bench {

/// The questions of one seed.
struct SceneGroup {
    std::string name;  // tuned or held out
    std::uint64_t seed = 0;
    std::vector<Question> questions;
};

[[nodiscard]] cli::Json group_json(const SceneGroup& group);
void print_group_head(const SceneGroup& group, const SceneBench& options, int threads);
/// Names the scene if it is another one than that of `before`, which may be null.
void print_question(const Question& question, const Question* before);

/// Of each workload, figure and group: the median of the ratios, and the worst of them.
[[nodiscard]] cli::Json summary_json(const std::vector<SceneGroup>& groups);
void print_summary(const cli::Json& summary);

}  // namespace raydix::bench
