// The workloads of `bench scene`: contents for both sides, and the questions that are asked.
#pragma once

#include <functional>

#include "scene_contest.h"

namespace raydix::bench {

/// Runs those that were asked for, and hands each question over when it is answered. Placement,
/// rays and viewpoints, and built-in scenes, come from `seed`.
void run_workloads(const SceneBench& options, std::uint64_t seed, int threads,
                   const std::function<void(const Question&)>& answered);

}  // namespace raydix::bench
