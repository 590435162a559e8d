// What `bench scene` can be asked.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>
#include <string>
#include <vector>

#include "cli/options.h"

namespace raydix::bench {

/// The workloads by name, in the order in which they run.
inline const std::vector<std::string> scene_workloads{"instances", "plants",   "nested",  "spheres",
                                                      "user",      "all_hits", "filters", "closest",
                                                      "doubles",   "moved",    "fixed",   "frames"};

struct SceneBench {
    cli::CommonOptions common;  // its seed is that of the held-out group
    std::vector<std::string> scenes, only = scene_workloads;
    std::string quality = "balanced", size = "512x384", clock = "wall";
    std::uint64_t instances = 1000, plants = 10'000, shapes = 1'000'000, moved = 10'000,
                  queries = 200'000, pieces = 1000;
    std::vector<std::uint64_t> frames{100'000, 1'000'000};  // triangles
    int rounds = 5;
    double tolerance = 1e-5;
    bool quick = false;

    [[nodiscard]] bool wants(const std::string& workload) const;
};

}  // namespace raydix::bench
