// Spatial splits: a plane cuts a node's box, and references that it cuts go to both sides, each
// with the box of its own part. Stich, Friedrich, Dietrich 2009, "Spatial Splits in Bounding Volume
// Hierarchies", sections 3 and 4.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "tree/split_bins.h"
#include "tree/triangle_corners.h"

namespace raydix {

inline constexpr std::uint32_t max_spatial_bins = 128;

/// Most nodes are small: few references need few planes.
[[nodiscard]] constexpr std::uint32_t spatial_bin_count(std::size_t references,
                                                        std::uint32_t most) {
    const std::uint32_t bins = references < 64      ? 8
                               : references < 1024  ? 16
                               : references < 16384 ? 32
                                                    : max_spatial_bins;
    return bins < most ? bins : most;
}

/// References left of the plane and right of it; those across count on both sides.
struct SpatialSplit {
    float cost = infinity;  // area(left) * left + area(right) * right, half surfaces
    std::uint32_t axis = 0;
    float plane = 0;
    std::uint32_t left = 0, right = 0;
    Aabb left_box{}, right_box{};
};

/// What a cut leaves of a reference on each side; a side may have nothing.
struct CutReference {
    Aabb left, right;
};

/// Cuts references to triangles of a mesh. A reference is a box, `first` the triangle's id.
class ReferenceCutter {
public:
    explicit ReferenceCutter(const TriangleCorners& corners) : corners_(corners) {}

    /// The boxes cover what the reference's box holds of its triangle. At least one is not empty.
    [[nodiscard]] CutReference cut(const SplitBox& reference, std::uint32_t axis,
                                   float plane) const;
    [[nodiscard]] std::array<Vec3, 3> corners(const SplitBox& reference) const {
        return corners_.rounded(reference.first);
    }

private:
    [[nodiscard]] CutReference cut_with_room(const SplitBox& reference, std::uint32_t axis,
                                             float plane) const;

    TriangleCorners corners_;
};

/// The best of bins - 1 planes on each axis; of equals the lowest (axis, plane). `box` is that of
/// the references; 2 to max_spatial_bins bins.
[[nodiscard]] SpatialSplit find_spatial_split(const ReferenceCutter& cutter,
                                              std::span<const SplitBox> references, const Aabb& box,
                                              std::uint32_t bins);

/// What becomes of each reference of a node.
class SpatialSides {
public:
    /// A reference across the plane stays whole on one side where that costs no more (reference
    /// unsplitting, section 4.4 of the paper).
    void choose(const ReferenceCutter& cutter, std::span<const SplitBox> references,
                const SpatialSplit& split);

    [[nodiscard]] std::uint32_t left() const { return left_count_; }
    [[nodiscard]] std::uint32_t right() const { return right_count_; }
    [[nodiscard]] std::uint32_t cuts() const { return static_cast<std::uint32_t>(cuts_.size()); }

    /// Both sides' references, in the old order.
    void divide(std::span<const SplitBox> references, SplitBox* to_left, SplitBox* to_right) const;

private:
    enum Side : std::uint8_t { left_side, right_side, both_sides };

    std::vector<Side> sides_;         // [references]
    std::vector<CutReference> cuts_;  // of those on both sides
    std::uint32_t left_count_ = 0, right_count_ = 0;
};

}  // namespace raydix
