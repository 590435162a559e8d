// What `bench cpu` can be asked.
#pragma once

#include <string>
#include <vector>

#include "cli/options.h"
#include "cli/ray_launches.h"

namespace raydix::bench {

struct CpuBench {
    cli::CommonOptions common;
    cli::LaunchOptions launches;
    std::vector<std::string> scenes, held_out;
    std::string cameras_file, workloads = "all", clock = "wall";
    std::vector<std::string> qualities{"balanced", "high"};
    std::vector<std::string> embree{"medium", "high", "medium+robust", "high+robust"};
    std::vector<std::string> isas;  // empty: the best; "all": each that the processor has
    int rounds = 3;
    double tolerance = 1e-5;
    bool all_paths = false, threads_study = false, sah = false, no_builds = false, no_rays = false;
    bool resume = false;
    std::string build_of;  // a peer: this process builds it and does nothing else
};

}  // namespace raydix::bench
