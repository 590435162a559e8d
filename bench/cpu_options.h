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
    std::vector<std::string> scenes;
    std::string cameras_file, rays = "all";
    std::vector<std::string> qualities{"fast", "balanced", "high"};
    std::vector<std::string> embree{"medium", "high", "medium+compact", "medium+robust"};
    std::vector<std::string> isas;  // empty: the best; "all": each that the processor has
    int max_leaf = 4, width = 8;    // of our trees
    int rounds = 5;
    double tolerance = 1e-5;
    bool all_paths = false, threads_study = false, sah = false, no_builds = false, no_rays = false;
    std::string build_of;  // a peer: this process builds it and does nothing else
};

}  // namespace raydix::bench
