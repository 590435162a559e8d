// Pictures of trees: their boxes as wire frames around the scene, and their cells in a slice.
#pragma once

#include <raydix/bvh.h>
#include <raydix/camera.h>
#include <raydix/kdtree.h>
#include <raydix/octree.h>
#include <raydix/picture.h>
#include <raydix/types.h>

#include <cstdint>
#include <span>
#include <vector>

namespace raydix {

/// The part of space that a node stands for, and its level: the root's is 0. Any tree that can list
/// such boxes can be drawn.
struct LevelBox {
    Aabb box;
    std::uint32_t level;
};

/// Levels first, first + 1, ..., last.
struct LevelRange {
    std::uint32_t first = 0, last = 0xFFFFFFFFu;

    [[nodiscard]] constexpr bool contains(std::uint32_t level) const {
        return level >= first && level <= last;
    }
};

/// The boxes of the nodes on these levels, in preorder.
[[nodiscard]] std::vector<LevelBox> level_boxes(const Bvh& bvh, LevelRange levels = {});
/// The cells of the nodes on these levels, in preorder: the bounds of the tree, cut at the planes
/// above the node. Below a node that parts equal codes all have its cell and are left out.
[[nodiscard]] std::vector<LevelBox> level_boxes(const KdTree& tree, LevelRange levels = {});

/// The cubes of the nodes on these levels, level by level.
[[nodiscard]] std::vector<LevelBox> level_boxes(const Octree& octree, LevelRange levels = {});

/// Renders the shaded scene, darkened, with the boxes as wire frames. Lines are wide and pale
/// yellow on the first of their levels, and go over orange to thin and violet on the last. Behind
/// surfaces they are fainter. `scene` is a tree over triangles, or over points, which become dots.
/// options.view has no effect. The picture does not depend on the number of threads. Throws
/// InputError as `render` does.
[[nodiscard]] Picture render_tree(const Bvh& scene, const Camera& camera,
                                  std::span<const LevelBox> boxes,
                                  const RenderOptions& options = {});

struct SliceOptions {
    std::uint32_t axis = 2;  // 0, 1, 2: the slice is perpendicular to x, y, z
    float at = 0.5f;         // where it cuts the scene's box: 0 at its lower end, 1 at its upper
    std::uint32_t width = 1024, height = 768;  // each 1..16384
};

/// Shows what lies in one plane: the boxes that it cuts, and the scene itself. Boxes are filled,
/// dark indigo on the first of their levels and pale yellow on the last. Deeper levels lie over
/// those above them. Boxes of at least 5 pixels a side have edges. Of the scene it shows where
/// triangles are cut, or the points that lie within 1/200 of the scene's box. The other two axes
/// run to the right and up, in their order. Throws InputError: an axis, place or size out of range.
[[nodiscard]] Picture render_slice(const Bvh& scene, std::span<const LevelBox> boxes,
                                   const SliceOptions& options = {});

}  // namespace raydix
