// A question of `bench scene`: answers of both sides compared first, then all modes timed in turns
// (A B A B ...), launch by launch.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "scene_compare.h"
#include "scene_options.h"

namespace raydix::bench {

/// One mode of one side.
struct TimedMode {
    std::string side, name;
    bool ours = false, single = false, robust = false;
    std::vector<double> ms;                  // of each round, summed over the launches
    std::optional<Differences> differences;  // of peers, where we have an answer
};

struct Question {
    std::string workload, scene, text{};  // "instances", "conference.ply.xz", "primary closest"
    std::uint64_t primitives = 0;         // instances, triangles, shapes: of the whole scene
    std::uint64_t count = 0;              // rays or queries
    std::uint64_t hits = 0;               // of them, by us or else by the first peer
    bool in_ms = false;                   // figures are milliseconds, not rates
    bool compares_times = false;          // ratios are of times: less is better
    std::vector<TimedMode> modes{};
};

/// The best of a question's peers beside ours, and rounds compared pair by pair.
struct Ratio {
    std::string figure;              // batch, single, single robust
    std::size_t ours = 0, peer = 0;  // of the modes
    double median = 0, min = 0, max = 0;
};
/// Ours over the peer's: of rates, or of times.
[[nodiscard]] std::vector<Ratio> ratios_of(const Question& question);

using RaySides = std::vector<std::unique_ptr<RaySide>>;

/// closest, then any. `ours` may be null: then the peers are timed alone. Our own modes must agree
/// bit for bit, else it throws.
[[nodiscard]] std::vector<Question> ask_rays(const Question& about, const RayKindOf& rays,
                                             RaySide* ours, const RaySides& peers,
                                             const SceneBench& options);
[[nodiscard]] Question ask_all_hits(const Question& about, const RayKindOf& rays, AllHitsSide& ours,
                                    const std::vector<std::unique_ptr<AllHitsSide>>& peers,
                                    const SceneBench& options);
/// `mesh` answers what the two sides do not agree about.
[[nodiscard]] Question ask_closest(const Question& about, std::span<const Vec3> queries,
                                   const Mesh& mesh, ClosestSide& ours,
                                   const std::vector<std::unique_ptr<ClosestSide>>& peers,
                                   const SceneBench& options);
/// Commits alone, then transforms and commits, where each round moves all instances; then where it
/// moves the first hundredth. Rays are compared after each.
[[nodiscard]] std::vector<Question> ask_moving(
    const Question& about, const std::array<std::vector<Affine>, 2>& places, const RayKindOf& rays,
    MovingSide& ours, const std::vector<std::unique_ptr<MovingSide>>& peers,
    const SceneBench& options);

}  // namespace raydix::bench
