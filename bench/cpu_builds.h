// Times of builds, sizes of trees. Peers in one process disturb each other through the memory that
// they free, so each build of a round has a process of its own, and the processes of a round follow
// each other.
#pragma once

#include <string>
#include <vector>

#include "cpu_peers.h"

namespace raydix::bench {

/// For each peer and each of `thread_counts`, in this order. ROBUST trees stand beside single calls
/// alone, so they are left out.
[[nodiscard]] std::vector<BuildFigures> measure_builds(const std::string& scene,
                                                       const CpuBench& options,
                                                       const std::vector<int>& thread_counts);

/// What such a process does: builds options.build_of, prints one JSON object.
void print_builds_of_one_peer(const CpuBench& options);

}  // namespace raydix::bench
