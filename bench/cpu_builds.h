// Times of builds. Peers in one process disturb each other through the memory that they free, so
// each build of a round has a process of its own, and the processes of a round follow each other.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cpu_peers.h"

namespace raydix::bench {

/// Of one peer with one number of threads.
struct PeerBuilds {
    PeerName peer;
    int threads = 0;
    std::vector<double> fresh_ms;   // the first build of each process
    std::vector<double> kept_ms;    // those behind it, into memory that is kept
    std::vector<double> layout_ms;  // the part of kept_ms that went to the wide layout; ours only
    PeerBytes bytes;
    std::optional<double> sah;
};

/// For each peer and each of `thread_counts`, in this order.
[[nodiscard]] std::vector<PeerBuilds> measure_builds(const std::string& scene,
                                                     const CpuBench& options,
                                                     const std::vector<int>& thread_counts);

/// What such a process does: builds options.build_of, prints one JSON object.
void print_builds_of_one_peer(const CpuBench& options);

}  // namespace raydix::bench
