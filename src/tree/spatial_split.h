// Spatial splits: a plane cuts a node's box, and references that it cuts go to both sides, each
// with the box of its own part. Stich, Friedrich, Dietrich 2009, "Spatial Splits in Bounding Volume
// Hierarchies", sections 3 and 4.
#pragma once

#include <raydix/mesh.h>

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "tree/sah_reference.h"

namespace raydix {

/// Bins an axis.
inline constexpr std::uint32_t spatial_bins = 128;
/// Spatial splits are tried where the two boxes of the best object split share more than this part
/// of the root's surface (alpha in the paper).
inline constexpr float least_overlap = 1e-5f;

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

/// Cuts references to triangles of a mesh.
class ReferenceCutter {
public:
    explicit ReferenceCutter(const MeshView& mesh) : mesh_(mesh) {}

    /// The boxes cover what the reference's box holds of its triangle. At least one is not empty.
    [[nodiscard]] CutReference cut(const SahReference& reference, std::uint32_t axis,
                                   float plane) const;
    [[nodiscard]] std::array<Vec3, 3> corners(const SahReference& reference) const {
        const Triangle& t = mesh_.triangles[reference.primitive_id];
        return {mesh_.vertices[t[0]], mesh_.vertices[t[1]], mesh_.vertices[t[2]]};
    }

private:
    MeshView mesh_;
};

/// The best of 127 planes on each axis; of equals the lowest (axis, plane). `places`: the node's
/// references, in any order; `box` is theirs.
[[nodiscard]] SpatialSplit find_spatial_split(const ReferenceCutter& cutter,
                                              const SahReference* references,
                                              std::span<const std::uint32_t> places,
                                              const Aabb& box);

/// What becomes of each reference of a node.
struct SpatialSides {
    enum Side : std::uint8_t { left, right, both };
    std::vector<Side> sides;        // [places]
    std::vector<CutReference> cut;  // of those on both sides, in the order of the places
    std::uint32_t left_count = 0, right_count = 0;
};

/// A reference across the plane stays whole on one side where that costs no more (reference
/// unsplitting, section 4.4 of the paper).
void choose_sides(const ReferenceCutter& cutter, const SahReference* references,
                  std::span<const std::uint32_t> places, const SpatialSplit& split,
                  SpatialSides& out);

/// A place and the key it is sorted by.
struct KeyedPlace {
    float key;
    std::uint32_t primitive_id, place;

    KeyedPlace(const SahReference* references, std::uint32_t at, std::uint32_t axis)
        : key((&references[at].lo.x)[axis] + (&references[at].hi.x)[axis]),
          primitive_id(references[at].primitive_id),
          place(at) {}
    bool operator<(const KeyedPlace& other) const {
        if (key != other.key) return key < other.key;
        return primitive_id != other.primitive_id ? primitive_id < other.primitive_id
                                                  : place < other.place;
    }
};

/// A node's sorted lists after a spatial split.
class SideLists {
public:
    /// Cuts the references that go to both sides: the left part stays in its place, the right one
    /// goes to the next of `free_places`. `order` is the list that `sides` is about; `side_of`
    /// [places] is written.
    void cut(SahReference* references, std::span<const std::uint32_t> order,
             const SpatialSides& sides, std::uint32_t free_places, std::uint8_t* side_of);

    /// The list of one side on one axis, from the node's. Nothing but what was cut is sorted.
    /// Returns the end of what was written.
    std::uint32_t* list(const SahReference* references, std::span<const std::uint32_t> order,
                        const std::uint8_t* side_of, SpatialSides::Side side, std::uint32_t axis,
                        std::uint32_t* out);

    /// Whether the right side alone holds the smallest id.
    [[nodiscard]] bool right_is_least() const { return least_[1] < least_[0]; }

private:
    std::vector<std::uint32_t> parts_[2];
    std::vector<KeyedPlace> sorted_;
    std::uint32_t least_[2]{};
};

}  // namespace raydix
