// Octrees over points and over the centres of triangles, and what can be asked of them.
#pragma once

#include <raydix/buffer.h>
#include <raydix/bvh.h>
#include <raydix/check.h>
#include <raydix/mesh.h>
#include <raydix/types.h>

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace raydix {

/// Stands for "no such node".
inline constexpr std::uint32_t no_node = 0xFFFFFFFFu;

struct OctreeOptions {
    int bits = 63;        // Morton code bits, 30 or 63: at most 10 or 21 levels below the root
    int max_level = -1;   // 0..10 or 0..21, the level that is not divided any more; -1: the highest
    int max_leaf = 4;     // 1.. points; a node with more is divided, unless it is at max_level
    bool strict = false;  // invalid primitives are an InputError instead of being left out
    int threads = 0;      // 0 to 1,024; 0: all the machine has. The tree does not depend on it
};

/// A node of 32 bytes. At level k it is a cell of the grid that cuts the root in 2^k parts along
/// each axis. Only cells with points in them are nodes. The points of a node, leaf or not, stand at
/// [first_point, first_point + point_count) of the leaf order. Its children follow each other from
/// `first_child` on, ascending by octant.
struct OctreeNode {
    std::uint64_t code;    // interleaved cell coordinates, 3 * level bits, x highest in each triple
    std::uint32_t parent;  // no_node for the root
    std::uint32_t first_child;  // no_node for a leaf
    std::uint32_t first_point;
    std::uint32_t point_count;
    std::uint32_t child_mask;  // bit k: octant k has points; k = 4 x + 2 y + z, 1 = upper half
    std::uint32_t level;       // 0 is the root

    [[nodiscard]] constexpr bool is_leaf() const { return child_mask == 0; }
    /// The child in an octant, no_node if it has no points.
    [[nodiscard]] constexpr std::uint32_t child(std::uint32_t octant) const {
        if ((child_mask >> octant & 1u) == 0) return no_node;
        const std::uint32_t before = child_mask & ((1u << octant) - 1u);
        return first_child + static_cast<std::uint32_t>(std::popcount(before));
    }
};
static_assert(sizeof(OctreeNode) == 32);

/// Nodes [begin, end) of one level.
struct NodeRange {
    std::uint32_t begin = 0, end = 0;

    [[nodiscard]] constexpr std::uint32_t size() const { return end - begin; }
};

/// A finished octree (Karras 2012, section 5). A node is divided if it has more than max_leaf
/// points and its level is below max_level. Nodes are numbered level by level, and by code within a
/// level. The tree does not depend on the number of threads. It holds all that queries read; the
/// input may go. A tree without valid points has no nodes; else nodes()[0] is the root.
class Octree {
public:
    /// Empty.
    Octree() { options_.max_level = 21; }

    [[nodiscard]] bool empty() const { return order_.empty(); }
    [[nodiscard]] std::span<const OctreeNode> nodes() const { return nodes_.view(); }
    /// Position in leaf order -> the caller's primitive id, [references]. Ascending by Morton code,
    /// equal codes by id.
    [[nodiscard]] std::span<const std::uint32_t> order() const { return order_.view(); }
    /// The points in leaf order, [references]; of triangles the centres of their boxes.
    [[nodiscard]] std::span<const Vec3> points() const { return points_.view(); }

    /// Levels that have nodes: 0 if the tree is empty, else the deepest level + 1.
    [[nodiscard]] std::uint32_t level_count() const;
    /// The nodes of a level; empty past the deepest. Together with `node_box` this gives the boxes
    /// of a level for a picture.
    [[nodiscard]] NodeRange level_nodes(std::uint32_t level) const;

    /// `triangles` or `points`.
    [[nodiscard]] PrimitiveKind kind() const { return kind_; }
    /// As given, with max_level resolved.
    [[nodiscard]] const OctreeOptions& options() const { return options_; }
    /// Primitives the caller gave, and how many of them were invalid and left out.
    [[nodiscard]] std::uint64_t input_count() const { return input_count_; }
    [[nodiscard]] std::uint64_t left_out() const { return left_out_; }
    /// The box around all valid primitives, which the grid is laid on; lo > hi if there are none.
    [[nodiscard]] Aabb bounds() const { return bounds_; }

    /// `hierarchy` is the octree itself; `fit` is 0.
    [[nodiscard]] const BuildMs& build_ms() const { return build_ms_; }
    /// Most bytes that the build held at once, tree included, above its input.
    [[nodiscard]] std::uint64_t peak_bytes() const { return peak_bytes_; }
    /// Every byte a query can touch.
    [[nodiscard]] std::uint64_t bytes() const;

private:
    friend struct OctreeInternals;  // the builder (src) fills the arrays through it
    Buffer<OctreeNode> nodes_;
    Buffer<std::uint32_t> order_;
    Buffer<Vec3> points_;
    std::array<std::uint32_t, 23> level_begin_{};  // [level_count + 1], the rest repeats the last
    PrimitiveKind kind_ = PrimitiveKind::points;
    OctreeOptions options_;
    Aabb bounds_{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
    std::uint64_t input_count_ = 0;
    std::uint64_t left_out_ = 0;
    BuildMs build_ms_;
    std::uint64_t peak_bytes_ = 0;
};

/// Builds an octree over points. Points that are not finite or beyond 1e12 are left out and
/// counted. Throws InputError: an option out of range, 2^28 points or more; with `options.strict`
/// the first point that would be left out.
[[nodiscard]] Octree build_octree(std::span<const Vec3> points, const OctreeOptions& options = {});

/// The same over the mesh's triangles, each standing at the centre of its box; if it has none, over
/// its vertices. Throws also for a vertex index past the end.
[[nodiscard]] Octree build_octree(const MeshView& mesh, const OctreeOptions& options = {});
[[nodiscard]] Octree build_octree(const Mesh& mesh, const OctreeOptions& options = {});

/// The cube of a node, as floats. `lo` is the least float in the node's cell of the Morton grid,
/// and `hi` the least one in the next cell. A point of the root belongs to the node exactly if lo
/// <= p < hi on each axis, or p == hi where the node touches the root's upper face. Faces of
/// neighbours have the same bits. The root's upper face is lo + longest edge, or the scene's own
/// where rounding puts that farther. Throws InputError if there is no such node.
[[nodiscard]] Aabb node_box(const Octree& octree, std::uint32_t node_index);

/// The deepest node whose cell holds the point: a leaf, or an inner node if the point is in an
/// octant that has no points. no_node for a point outside of the root's closed cube, a non-finite
/// one and the empty tree.
[[nodiscard]] std::uint32_t locate(const Octree& octree, Vec3 point);
/// For many: [points] -> [nodes].
[[nodiscard]] std::vector<std::uint32_t> locate(const Octree& octree, std::span<const Vec3> points,
                                                int threads = 0);

/// A step to one of the 26 cells around a cell: each of dx, dy, dz is -1, 0 or 1. One that is not 0
/// crosses a face, two an edge, three a corner.
struct Direction {
    int dx = 0, dy = 0, dz = 0;
};
/// All 26, ascending by (dx, dy, dz).
[[nodiscard]] std::array<Direction, 26> all_directions();

/// The neighbour of equal or greater size (Samet 1989): the node that holds the cell of this node's
/// level one step in `direction` and is at this level or, being a leaf, above it. no_node if that
/// cell is outside of the root or has no points. Throws InputError: no such node, or a direction
/// that is zero or has a component beyond 1.
[[nodiscard]] std::uint32_t neighbour(const Octree& octree, std::uint32_t node_index,
                                      Direction direction);
/// For many nodes in one direction: [nodes] -> [nodes].
[[nodiscard]] std::vector<std::uint32_t> neighbour(const Octree& octree,
                                                   std::span<const std::uint32_t> nodes,
                                                   Direction direction, int threads = 0);
/// In all directions, in the order of all_directions().
[[nodiscard]] std::array<std::uint32_t, 26> neighbours(const Octree& octree,
                                                       std::uint32_t node_index);

/// Points in boxes as CSR: row q is ids[offsets[q], offsets[q + 1]), ascending.
struct PointsInBoxes {
    std::vector<std::uint64_t> offsets;  // [boxes + 1]
    std::vector<std::uint32_t> ids;
    std::uint64_t invalid_queries =
        0;  // boxes with lo > hi or a non-finite bound; their rows are empty
};

/// Finds the ids of the points p with lo <= p <= hi on every axis, compared as floats. Of triangles
/// it is the centers that are asked about. `max_result_bytes` is the most that the call may hold;
/// 0: half of what is left to the process (result_limit.h). Throws ResultTooLarge, an InputError,
/// if it would take more; no id is ever dropped.
[[nodiscard]] std::vector<std::uint32_t> points_in_box(const Octree& octree, const Aabb& box,
                                                       std::uint64_t max_result_bytes = 0);
[[nodiscard]] PointsInBoxes points_in_boxes(const Octree& octree, std::span<const Aabb> boxes,
                                            int threads = 0, std::uint64_t max_result_bytes = 0);

struct OctreeStats {
    std::uint64_t nodes = 0;  // inner + leaves
    std::uint64_t leaves = 0;
    std::uint64_t references = 0;                // points in leaves
    std::uint32_t max_depth = 0;                 // the deepest level that has nodes
    std::uint32_t max_level = 0;                 // the level where division ends
    std::uint64_t largest_leaf = 0;              // most points in a leaf
    std::vector<std::uint64_t> nodes_per_level;  // [max_depth + 1]; empty for the empty tree
    std::uint64_t bytes = 0;
    std::string tree_hash;  // 32 hex digits
};
[[nodiscard]] OctreeStats octree_stats(const Octree& octree);

/// 128 bits as hex over the canonical tree. XXH3-128 (seed 0) of a little-endian byte stream: tree
/// kind (uint32, 1 = octree), bits, max_leaf, max_level (uint32), the six floats of bounds() if the
/// tree is not empty, then in preorder, lower octant first, per node its level and the low and the
/// high word of its code, per leaf also its count and primitive ids (uint32).
[[nodiscard]] std::string tree_hash(const Octree& octree);

/// Every invariant: nodes in level order, children complete and in octant order, point ranges that
/// tile their parent's, divided exactly where the rule asks for it, each primitive in one leaf and
/// in order, each point in the cell of its leaf. Names the first that is broken.
[[nodiscard]] CheckReport check(const Octree& octree);
/// The same, and the points are bit for bit those of `mesh`, and the bounds its own.
[[nodiscard]] CheckReport check(const Octree& octree, const MeshView& mesh);

}  // namespace raydix
