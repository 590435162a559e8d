// Moving primitives under a tree that stays: the boxes are fitted again, the hierarchy is kept.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include <span>

namespace raydix {

/// How good a tree still is. Boxes that grow into each other cost rays time. From a ratio of about
/// 1.5 on a new build usually pays.
struct RefitQuality {
    double sah = 0;           // of the tree as it is now (docs/contract.md 2, costs 1 and 1)
    double sah_at_build = 0;  // of the tree that the Refitter was made for
    double ratio = 1;         // sah / sah_at_build; 1 if either tree has no area
};

/// Fits a tree to new places of its primitives, again and again. Made from the tree as it was
/// built, to compare with.
class Refitter {
public:
    /// Throws InputError for a tree that holds parts of triangles (Bvh::has_split_primitives): the
    /// parts are not kept, and if `threads` is not 0 to 1,024. 0: all the machine has.
    explicit Refitter(const Bvh& built, int threads = 0);

    /// Gives the tree new corners, with any indices, for the same number of triangles in the same
    /// order; or new places for points. The hierarchy stays, and boxes are fitted to the new
    /// places. Bvh::refitted() is true from then on. Needs the tree for itself. Throws InputError,
    /// and the tree is unchanged: another number of primitives than the tree was built from, an
    /// index past the vertices, a primitive of the tree that is not valid any more, one that was
    /// left out and is valid now, a tree that holds parts of triangles. Throws InputError, and the
    /// tree is empty: a triangle smaller than 1e-12 that is no point.
    RefitQuality refit(Bvh& bvh, const MeshView& mesh, int threads = 0) const;
    /// The same for a tree of boxes. A box smaller than 1e-12 leaves the tree empty.
    RefitQuality refit(Bvh& bvh, std::span<const Aabb> boxes, int threads = 0) const;

private:
    double sah_at_build_;
};

/// One refit; the quality is relative to the tree before it.
RefitQuality refit(Bvh& bvh, const MeshView& mesh, int threads = 0);
RefitQuality refit(Bvh& bvh, std::span<const Aabb> boxes, int threads = 0);

}  // namespace raydix
