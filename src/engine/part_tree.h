// Boxes -> a wide tree over them: those of a scene's parts, or of the primitives of a geometry.
#pragma once

#include <cstdint>
#include <span>

#include "engine/scene_tree.h"
#include "engine/scene_tree_double.h"
#include "layout/wide_collapse.h"

namespace raydix {

/// Parts whose error is larger than this stand in a tree of their own.
inline bool is_wild(const Extent& extent) { return !(extent.error <= 0x1p-12); }

/// `parts`: those that the tree holds, not empty and in the range of coordinates; extents [all
/// parts].
void build_part_tree(std::span<const std::uint32_t> parts, std::span<const Extent> extents,
                     Quality quality, PartTree& out);

/// The nodes of `old` around where the parts are now. False, and `out` has no meaning, if it holds
/// other parts, or if its cost would be more than `limit` times that at its build.
[[nodiscard]] bool refit_part_tree(const PartTree& old, std::span<const std::uint32_t> parts,
                                   std::span<const Extent> extents, double limit, PartTree& out);

struct MovedPart {
    std::uint32_t part;
    Extent extent;
};

/// A refit of a tree in place where few parts moved.
class PartMoves {
public:
    /// moved: each part stands in the tree, and once here, with its new place; extents [all parts]:
    /// where they were.
    PartMoves(std::span<MovedPart> moved, std::span<Extent> extents, PartTree& tree);

    /// Whether it can be done. The tree and `extents` are as before. False: the bounds do not hold
    /// the point any more that planes are about, or the cost would be more than `limit` times that
    /// at the build.
    [[nodiscard]] bool plan(double limit) noexcept;
    /// Once, after a plan that can be done. Planes of nodes stay about the same point, also where
    /// the bounds change. All else is as after refit_part_tree; `extents` has the new places and
    /// `moved` the old ones.
    void apply() noexcept;

private:
    struct Node {  // that changes, with what it has when the other state is in the tree
        std::uint32_t number;
        Aabb box;
        double area;
        WideNode node;
    };

    void refit() noexcept;
    std::uint32_t take_last() noexcept;
    void exchange_extents() noexcept;
    void exchange_nodes() noexcept;

    std::span<MovedPart> moved_;
    std::span<Extent> extents_;
    PartTree& tree_;
    std::vector<std::uint32_t> waiting_;  // numbers of nodes, a heap
    std::vector<Node> nodes_;
    Extent around_;  // all parts
};

/// In double: [parts], those that are empty are left out and the others must be in range.
void build_part_tree(std::span<const ExtentD> extents, Quality quality, PartTreeD& out);
/// The same for the primitives of a geometry, of any size.
void build_box_tree(std::span<const ExtentD> extents, const BuildOptions& build, PartTreeD& out);

/// Leaves hold the numbers of boxes, as `leaves` says. Boxes that builders leave out are left out.
/// `out.growth` stays as it is.
void build_box_tree(std::span<const Aabb> boxes, BuildOptions build, const WideOptions& leaves,
                    PartTree& out);

/// Leaves of one part each name it, so that rays need not look up which one it is. `tree.part`
/// still lists them, in the order of leaves. Numbers must be less than 2^28 - 1.
void name_parts_in_leaves(PartTree& tree);

/// As refit_part_tree, for new boxes of which the same are valid.
[[nodiscard]] bool refit_box_tree(const PartTree& old, std::span<const Aabb> boxes, double limit,
                                  PartTree& out);

}  // namespace raydix
