// k-d trees over points and triangles, built from the same Morton codes as the BVH, with nearest
// neighbours and rays that descend them.
#pragma once

#include <raydix/buffer.h>
#include <raydix/bvh.h>
#include <raydix/check.h>
#include <raydix/mesh.h>
#include <raydix/trace.h>
#include <raydix/types.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace raydix {

struct KdTreeOptions {
    int bits = 63;        // Morton code bits, 30 or 63: 10 or 21 halvings of each axis
    int max_leaf = 0;     // 1..255 primitives in a leaf; more means fewer nodes and more tests.
                          // 0: 8 points or 4 triangles
    bool strict = false;  // invalid primitives are an InputError instead of being left out
    int threads = 0;      // 0 to 1,024; 0: all the machine has. The tree does not depend on it
};

/// A node of 16 bytes; the two children of a node lie side by side in 32.
///
/// An inner node splits `axis()` at the plane of the Morton grid where its codes first differ.
/// Primitives with their center below `plane` are on the left, all others on the right. `plane` is
/// infinity where all codes below the node are equal: then the first positions of the order are on
/// the left.
///
/// Every node but the root says in [lo, hi] how far its primitives reach along the axis that its
/// parent splits. Walks go by these intervals. They may be much smaller than the node's side of the
/// plane, since halvings that would leave one half empty make no node. Those of two children may
/// overlap: triangles reach over planes, and points where equal codes are parted.
struct KdNode {
    static constexpr std::uint32_t leaf_axis = 3;

    float lo, hi;  // closed; 0 and 0 in the root
    union {
        float plane;          // inner
        std::uint32_t first;  // leaf: its first position in the order
    };
    std::uint32_t link;  // low two bits: axis, or leaf_axis; the others: pair of children, or count

    [[nodiscard]] constexpr bool is_leaf() const { return (link & 3u) == leaf_axis; }
    /// 0, 1, 2: x, y, z.
    [[nodiscard]] constexpr std::uint32_t axis() const { return link & 3u; }
    /// Inner: the slot of the left child; the right one follows it.
    [[nodiscard]] constexpr std::uint32_t child() const { return (link >> 2) * 2 + 2; }
    /// Leaf: primitives at positions [first, first + count).
    [[nodiscard]] constexpr std::uint32_t count() const { return link >> 2; }
    /// Inner: whether equal codes are told apart by their position.
    [[nodiscard]] constexpr bool splits_equal_codes() const { return plane == infinity; }
};
static_assert(sizeof(KdNode) == 16);

/// A finished tree. Holds all that queries read; the input may go. A tree without valid primitives
/// has no nodes. Else nodes()[0] is the root, slot 1 is padding (all zero), and the children of
/// inner node r lie in slots 2r + 2 and 2r + 3.
class KdTree {
public:
    /// Empty.
    KdTree() { options_.max_leaf = 8; }

    [[nodiscard]] bool empty() const { return order_.empty(); }
    [[nodiscard]] std::span<const KdNode> nodes() const { return nodes_.view(); }
    /// Position in leaf order -> the caller's primitive id, [references].
    [[nodiscard]] std::span<const std::uint32_t> order() const { return order_.view(); }
    /// Corners in leaf order, [references]; empty unless built from triangles.
    [[nodiscard]] std::span<const LeafTriangle> triangles() const { return triangles_.view(); }
    /// Points in leaf order, [references]; empty unless built from points.
    [[nodiscard]] std::span<const Vec3> points() const { return points_.view(); }

    /// triangles or points.
    [[nodiscard]] PrimitiveKind kind() const { return kind_; }
    /// As given; max_leaf is what it stands for.
    [[nodiscard]] const KdTreeOptions& options() const { return options_; }
    [[nodiscard]] std::uint32_t inner_count() const { return inner_count_; }
    [[nodiscard]] std::uint32_t leaf_count() const { return empty() ? 0 : inner_count_ + 1; }
    /// Edges from the root to the deepest leaf, exact. Stacks of walks are sized from it.
    [[nodiscard]] std::uint32_t max_depth() const { return max_depth_; }
    /// Primitives the caller gave, and how many of them were invalid and left out.
    [[nodiscard]] std::uint64_t input_count() const { return input_count_; }
    [[nodiscard]] std::uint64_t left_out() const { return left_out_; }
    /// The box around all primitives; lo > hi if there are none.
    [[nodiscard]] const Aabb& bounds() const { return bounds_; }

    [[nodiscard]] const BuildMs& build_ms() const { return build_ms_; }
    /// Most bytes that the build held at once, tree included, above its input.
    [[nodiscard]] std::uint64_t peak_bytes() const { return peak_bytes_; }
    /// Every byte a query touches.
    [[nodiscard]] std::uint64_t bytes() const;

private:
    friend struct KdTreeInternals;  // the builder (src) fills the arrays through it
    Buffer<KdNode> nodes_;
    Buffer<std::uint32_t> order_;
    Buffer<LeafTriangle> triangles_;
    Buffer<Vec3> points_;
    PrimitiveKind kind_ = PrimitiveKind::points;
    KdTreeOptions options_;
    Aabb bounds_{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
    std::uint32_t inner_count_ = 0;
    std::uint32_t max_depth_ = 0;
    std::uint64_t input_count_ = 0;
    std::uint64_t left_out_ = 0;
    BuildMs build_ms_;
    std::uint64_t peak_bytes_ = 0;
};

/// Builds a k-d tree (Karras 2012, section 5) over the mesh's triangles, ordered by the centers of
/// their boxes, or, if it has none, over its vertices as points. Primitives that are not finite or
/// out of range are left out and counted. The tree does not depend on the number of threads. Throws
/// InputError: an option out of range, a vertex index past the end, 2^31 primitives or more, more
/// than 2^30 inner nodes; with `options.strict` the first primitive that would be left out.
[[nodiscard]] KdTree build_kdtree(const MeshView& mesh, const KdTreeOptions& options = {});
[[nodiscard]] KdTree build_kdtree(const Mesh& mesh, const KdTreeOptions& options = {});
[[nodiscard]] KdTree build_kdtree(std::span<const Vec3> points, const KdTreeOptions& options = {});

/// Figures of the tree, as docs/contract.md 2 has them for the BVH. `sah` and `epo` stay null:
/// nodes have no boxes.
[[nodiscard]] TreeStats kd_stats(const KdTree& tree);

/// 128 bits as hex over the canonical tree: equal exactly when topology, planes, intervals and
/// order are. XXH3-128 (seed 0) of a little-endian byte stream: tree kind (uint32, 2 = kdtree),
/// bits, max_leaf (uint32), the six floats of the bounds lo.xyz hi.xyz (not if the tree is empty),
/// then in preorder, left first, per node lo and hi, per inner node its axis (uint32) and plane,
/// per leaf the number 3, its count and its primitive ids (uint32).
[[nodiscard]] std::string kd_hash(const KdTree& tree);

/// Every invariant of the tree; names the first that does not hold: counts, links (no cycle, each
/// pair of slots used once), leaves in order and within max_leaf, each primitive once, codes
/// ascending, splits where codes first differ, axes, planes, tight intervals, bounds, exact depth.
[[nodiscard]] CheckReport kd_check(const KdTree& tree);
/// The same, and the leaf primitives are bit for bit those of `mesh`.
[[nodiscard]] CheckReport kd_check(const KdTree& tree, const MeshView& mesh);

/// A point near a query: the square of its distance, and its id. Missing ones: infinity and
/// no_primitive.
struct KdNeighbor {
    float d2 = infinity;
    std::uint32_t point = no_primitive;
};

struct KdQueryOptions {
    int threads = 0;        // 0 to 1,024; 0: all the machine has. Results do not depend on it
    bool counters = false;  // also count nodes and distances; costs a little time
    /// Bounds the peak of a call that makes room for its result. 0: half of what is left
    /// (result_limit.h).
    std::uint64_t max_result_bytes = 0;
};

/// What a batch met. The last two are 0 unless asked for.
struct KdQueryCounts {
    std::uint64_t queries = 0;
    std::uint64_t invalid_queries = 0;  // a coordinate is NaN or Inf: nothing is near
    std::uint64_t node_visits = 0;      // nodes entered, root and leaves included
    std::uint64_t distances = 0;        // points looked at
};

/// Finds the k nearest points of each query, ordered by (d2, id), where d2 = (dx*dx + dy*dy) +
/// dz*dz in float32 without FMA (docs/contract.md 8). queries [n] -> neighbors [n * k]. Where there
/// are fewer points, a row ends with missing ones. A distance whose square overflows is infinite,
/// but the point is found. The tree has one Morton grid over the whole box: where an outlier or
/// clusters far denser than the rest crowd many points into few cells, a query looks at most of
/// them. Take `build_points` (points.h) for such clouds. Throws InputError: sizes that do not fit,
/// k = 0, a tree of triangles. The form that returns a vector throws ResultTooLarge before it makes
/// room for too much.
KdQueryCounts kd_nearest(const KdTree& tree, std::span<const Vec3> queries, std::uint32_t k,
                         std::span<KdNeighbor> neighbors, const KdQueryOptions& options = {});
[[nodiscard]] std::vector<KdNeighbor> kd_nearest(const KdTree& tree, std::span<const Vec3> queries,
                                                 std::uint32_t k,
                                                 const KdQueryOptions& options = {});

/// Finds closest hits, front to back through the k-d tree. rays [n] -> hits [n]. They are bit for
/// bit those of `trace` on a BVH of the same triangles. Counters count nodes entered, root and
/// leaves included. Throws InputError: sizes that differ, a tree that holds points.
TraceCounts kd_trace(const KdTree& tree, std::span<const Ray> rays, std::span<Hit> hits,
                     const TraceOptions& options = {});
[[nodiscard]] std::vector<Hit> kd_trace(const KdTree& tree, std::span<const Ray> rays,
                                        const TraceOptions& options = {});

/// Says whether each ray hits anything at all: 1 or 0. rays [n] -> occluded [n].
TraceCounts kd_trace_any(const KdTree& tree, std::span<const Ray> rays,
                         std::span<std::uint8_t> occluded, const TraceOptions& options = {});

}  // namespace raydix
