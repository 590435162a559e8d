// Rays through the trees of all peers in turn (A B A B ...), portion by portion, hits compared
// first.
#pragma once

#include <memory>
#include <vector>

#include "cpu_figures.h"
#include "cpu_peers.h"
#include "cpu_workloads.h"

namespace raydix::bench {

/// A pass of fewer rays follows some of the same mode that are not timed: the other trees have just
/// been in the caches. After one the first mode of each library was still up to 1.7 times slower
/// than the others (dragon, Sapphire Rapids).
inline constexpr std::size_t rays_of_a_long_pass = std::size_t{1} << 18;
inline constexpr int warm_ups_of_a_short_pass = 4;

/// Modes that are ours must agree bit for bit, else this throws. Differences are found in the
/// warm-up, which is not timed.
[[nodiscard]] WorkloadFigures measure_rates(const Workload& workload, const WorkloadRays& rays,
                                            const std::vector<PeerName>& names,
                                            const std::vector<std::unique_ptr<Peer>>& peers,
                                            const CpuBench& options,
                                            const std::vector<int>& thread_counts);

}  // namespace raydix::bench
