// One step of a build with spatial splits: a list of references -> the lists of two children, by
// the best plane between bins of whole references or, where that one's children overlap, by a plane
// that cuts.
#pragma once

#include <cstdint>

#include "tree/small_splits.h"
#include "tree/spatial_split.h"

namespace raydix {

/// Deeper lists are divided in the middle, so that no stack overflows.
inline constexpr std::uint32_t deepest_sbvh_split = 96;

/// More cuts and bins: better trees, more time and memory.
struct SpatialOptions {
    /// References beyond one a triangle, at most, over triangles.
    double budget = 0.5;
    /// Spatial splits are tried where the boxes of the object split's children share more than this
    /// part of the root's surface (alpha in the paper) ...
    float least_overlap = 1e-4f;
    /// ... and more than this part of the node's own.
    float least_own_overlap = 0.2f;
    std::uint32_t object_bins = 32, spatial_bins = max_spatial_bins;  // an axis, at most
};

/// References [at, at + count), ascending by id, each id once, with room for `spare` more behind
/// them. The children's lists come to the same places of `other`.
struct SbvhList {
    SplitBox *at, *other;
    std::uint32_t count, spare, depth;

    [[nodiscard]] std::span<const SplitBox> references() const { return {at, count}; }
};

/// The left child holds the smaller first id; if both hold it, it is the lower one.
struct SbvhChildren {
    SbvhList left, right;
};

/// Scratch of one thread.
class SbvhDivider {
public:
    SbvhDivider(const ReferenceCutter& cutter, const SpatialOptions& options, float root_area,
                int width)
        : cutter_(cutter),
          options_(options),
          least_overlap_(options.least_overlap * root_area),
          width_(width) {}

    /// count >= 2.
    [[nodiscard]] SbvhChildren divide(const SbvhList& list);
    /// Whether neither the list nor any below it can have a spatial split.
    [[nodiscard]] bool is_object_only(const SbvhList& list) const;

private:
    [[nodiscard]] SbvhChildren divide_in_middle(const SbvhList& list) const;
    [[nodiscard]] SbvhChildren divide_few(const SbvhList& list);
    /// The spatial split is in sides_ if it is better and there is room for it.
    [[nodiscard]] bool choose_spatial(const SbvhList& list, const SplitSides& object);
    [[nodiscard]] SbvhChildren divide_by_plane(const SbvhList& list) const;

    const ReferenceCutter& cutter_;
    SpatialOptions options_;
    float least_overlap_;
    int width_;
    SpatialSides sides_;
};

}  // namespace raydix
