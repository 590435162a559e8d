// Answers of the two sides of `bench scene` beside each other, and why those that differ do.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "hit_distance.h"
#include "scene_side.h"

namespace raydix::bench {

/// Answers of a peer beside ours. Equal: both miss, or both hit at one distance within the
/// tolerance. What differs is explained
/// - for rays: it is at an edge. A ray that is moved by a little, within 2^-17 of its coordinates,
///   gets the peer's answer from us; or the peer's ROBUST tree gives our answer: the other one let
///   the ray through between two triangles or boxes;
/// - for all hits: as rays, or both have the same distances once each is counted only once;
/// - for closest points: ours is the distance that all triangles give in double.
struct Differences {
    std::uint64_t equal = 0;
    std::uint64_t other_primitive = 0;  // of the equal ones: at this distance there are several
    std::uint64_t hit_or_miss = 0;      // one hit, the other did not
    std::uint64_t distance = 0;         // both hit, at other distances; all hits: other rows
    std::uint64_t explained = 0;        // of the last two

    [[nodiscard]] std::uint64_t different() const { return hit_or_miss + distance; }
    [[nodiscard]] std::uint64_t unexplained() const { return different() - explained; }
};

void add(Differences& sum, const Differences& more);

/// Of one launch.
struct Answers {
    std::vector<PlacedHit> hits;      // closest
    std::vector<std::uint8_t> found;  // any

    Answers(const RaySide& side, bool any, std::size_t rays);
    friend bool operator==(const Answers&, const Answers&) = default;

    [[nodiscard]] std::uint64_t hit_count() const;
};

inline void send(const SideMode& mode, bool any) { any ? mode.any() : mode.closest(); }

/// What our answers to a launch are compared with, and how.
struct Comparison {
    std::span<const Ray> rays;
    const Answers& ours;
    const Answers* robust;  // of the peer's ROBUST tree, or null
    double tolerance;
    RaySide& side;         // ours, to be asked once more
    const SideMode& mode;  // of it
    const std::string& peer;

    [[nodiscard]] bool any() const { return !ours.found.empty(); }
    [[nodiscard]] bool hit_or_miss(const Answers& theirs, std::size_t i) const {
        return any() ? ours.found[i] != theirs.found[i]
                     : ours.hits[i].hit() != theirs.hits[i].hit();
    }
    [[nodiscard]] bool equal(const Answers& theirs, std::size_t i) const {
        return !hit_or_miss(theirs, i) &&
               (any() || !ours.hits[i].hit() ||
                !far_apart(rays[i], ours.hits[i].t, theirs.hits[i].t, tolerance));
    }
};
/// Throws if more differ than two tracers of one scene can explain, and so do the next two.
[[nodiscard]] Differences differences_of(const Comparison& with, const Answers& theirs);
/// `ours` are the rows of `side`, which is asked once more.
[[nodiscard]] Differences differences_of_rows(std::span<const Ray> rays,
                                              const std::vector<std::vector<float>>& ours,
                                              const AllHitsSide& theirs, const std::string& peer,
                                              double tolerance, AllHitsSide& side);
[[nodiscard]] Differences differences_of_distances(std::span<const Vec3> queries, const Mesh& mesh,
                                                   const ClosestSide& ours,
                                                   const ClosestSide& theirs,
                                                   const std::string& peer, double tolerance);

}  // namespace raydix::bench
