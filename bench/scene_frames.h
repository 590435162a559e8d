// The workload `frames` of `bench scene`: all vertices of a mesh move each frame. A frame is a
// commit, one picture of primary rays, and one AO ray for each pixel that is hit.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "scene_contest.h"

namespace raydix::bench {

/// A mesh in motion, and who looks at it. `mesh` must outlive it.
class MovingPicture {
public:
    MovingPicture(const Mesh& mesh, cli::Size size, std::uint64_t seed);

    /// It sways and twists about its height, a turn of both in 24 frames; without the room behind
    /// the last one.
    [[nodiscard]] std::vector<Vec3> vertices(std::uint64_t frame) const;
    [[nodiscard]] std::span<const Ray> primary() const { return primary_; }
    /// One ray for each hit of a primary ray, in their order.
    [[nodiscard]] std::vector<Ray> ao(std::span<const Vec3> vertices, const RaySide& hits) const;

private:
    const Mesh& mesh_;
    Aabb box_;
    std::uint64_t seed_;
    std::vector<Ray> primary_;
};

/// First whole frames, then their parts on our side and on that peer whose frames take the least
/// time. Each side takes the modes for primary and AO rays that were the fastest in a trial.
/// Ratios are of rates. `guide`: one more of ours; its hits say where AO rays start.
[[nodiscard]] std::vector<Question> ask_frames(const Question& about, const MovingPicture& picture,
                                               FrameSide& ours,
                                               const std::vector<std::unique_ptr<FrameSide>>& peers,
                                               FrameSide& guide, const SceneBench& options);

}  // namespace raydix::bench
