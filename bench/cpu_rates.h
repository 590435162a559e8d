// Rays through the trees of all peers in turn (A B A B ...), launch by launch, hits compared first.
#pragma once

#include <raydix/rays.h>

#include <vector>

#include "cpu_peers.h"

namespace raydix::bench {

/// Answers that are not those of our tracer.
struct Differences {
    std::uint64_t hit_or_miss = 0;  // one hit, the other did not
    std::uint64_t distance = 0;     // both hit, t beyond the tolerance
    [[nodiscard]] std::uint64_t sum() const { return hit_or_miss + distance; }
};

/// One mode of one peer with one number of threads, over all launches of a kind.
struct ModeRates {
    std::size_t peer = 0;  // of those given
    Mode mode;
    int threads = 0;
    std::vector<double> ms;  // of each round, summed over the launches
    Differences differences;
};

struct KindRates {
    RayKind kind = RayKind::primary;
    std::uint64_t rays = 0, launches = 0;
    std::vector<ModeRates> modes;
};

/// ao rays ask whether anything is hit; the others for the closest hit. Modes that are ours must
/// agree bit for bit, else this throws. Differences are found in the warm-up, which is not timed.
[[nodiscard]] KindRates measure_rates(RayKind kind, const cli::RayLaunches& launches,
                                      const std::vector<PeerName>& names,
                                      const std::vector<std::unique_ptr<Peer>>& peers,
                                      const CpuBench& options,
                                      const std::vector<int>& thread_counts);

}  // namespace raydix::bench
