// Figures of `bench cpu`, and their JSON: written, and read again by a run that goes on.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cli/output.h"

namespace raydix::bench {

struct PeerName {
    std::string text;  // "raydix balanced", "embree medium+robust"
    [[nodiscard]] bool ours() const { return text.starts_with("raydix "); }
    [[nodiscard]] std::string kind() const { return text.substr(7); }
    [[nodiscard]] std::string quality() const { return kind().substr(0, kind().find('+')); }
    [[nodiscard]] bool robust() const { return text.find("+robust") != std::string::npos; }
};

/// Bytes that a trace touches: of the tree's own, and of the caller's arrays that it reads.
struct PeerBytes {
    std::uint64_t own = 0, referenced = 0;
};

/// One peer with one number of threads.
struct BuildFigures {
    PeerName peer;
    int threads = 0;
    cli::Spread fresh_ms;                // the first build of each process
    cli::Spread kept_ms;                 // those behind it
    std::optional<cli::Spread> copy_ms;  // ours: the part of kept_ms that copied the mesh
    PeerBytes bytes;
    std::optional<double> sah;
};

/// Answers that are not those of our tracer.
struct Differences {
    std::uint64_t hit_or_miss = 0;  // one hit, the other did not
    std::uint64_t distance = 0;     // both hit, t beyond the tolerance
    [[nodiscard]] std::uint64_t sum() const { return hit_or_miss + distance; }
};

/// One mode of one peer with one number of threads.
struct ModeFigures {
    PeerName peer;
    std::string name;
    bool single = false;     // one ray a call
    bool automatic = false;  // what a user gets who asks for nothing
    int threads = 0;
    std::optional<cli::Spread> mrays_per_s;  // none: there were no rays
    Differences differences;                 // of peers
};

struct WorkloadFigures {
    std::string name;
    std::uint64_t rays = 0, calls = 0, hits = 0;
    std::vector<ModeFigures> modes;

    [[nodiscard]] double rays_a_call() const { return calls ? double(rays) / double(calls) : 0; }
};

struct SceneFigures {
    std::string group;  // tuned or held_out
    std::string scene;
    std::uint64_t triangles = 0;
    int threads = 0;  // the number that is compared; others are for the speed-up
    std::vector<BuildFigures> builds;
    std::vector<WorkloadFigures> workloads;

    [[nodiscard]] bool has(const std::string& workload) const;
};

[[nodiscard]] cli::Json figures_json(const SceneFigures& figures);
/// Of what figures_json has written.
[[nodiscard]] SceneFigures figures_from(const cli::Json& json);

}  // namespace raydix::bench
