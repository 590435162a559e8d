// Building bounding volume hierarchies.
#pragma once

#include <raydix/buffer.h>
#include <raydix/mesh.h>
#include <raydix/quality.h>
#include <raydix/types.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace raydix {

/// How the tree is built. `karras`, `lauterbach`, `garanzha` and `apetrei` give the same tree, bit
/// for bit. `karras` and `apetrei` take the least time; `lauterbach` is the slowest of the four and
/// is kept for study. The others give better trees for more time: `ploc` and `hploc` merge clusters
/// by surface area, `binned` splits by it, and `sweep` looks at every split. `split` cuts large
/// triangles into parts before the build and `sbvh` during it, so that one triangle may be in
/// several leaves. Over boxes and points `split` and `sbvh` are `sweep`.
enum class Builder : std::uint32_t {
    karras = 0,
    lauterbach = 1,
    garanzha = 2,
    apetrei = 3,
    ploc = 4,
    hploc = 5,
    binned = 6,
    sweep = 7,
    split = 8,
    sbvh = 9,
};
[[nodiscard]] std::string_view builder_name(Builder builder);
/// Throws InputError that lists the known names.
[[nodiscard]] Builder builder_from_name(std::string_view name);

/// How boxes are fitted. `levels` takes one launch per level, from the deepest up. `atomic` takes
/// one pass, in which the second child to arrive goes on. `as_published` is what the builder's
/// source does; on a device, leaves of `karras` climb 32 together. The boxes are the same.
enum class Fit : std::uint32_t { as_published = 0, levels = 1, atomic = 2 };

/// Costs of the surface area heuristic: one inner node, one primitive of a leaf.
struct SahConstants {
    double node = 1.0;
    double primitive = 1.0;
};

struct BuildOptions {
    Builder builder = Builder::karras;
    int bits = 63;     // of Morton codes, 30 or 63. 30 sorts a little faster, but crowds large
                       // scenes into few cells
    int max_leaf = 4;  // primitives in a leaf, 1 to 255. More means fewer nodes and more tests
    Fit fit = Fit::as_published;
    bool strict = false;  // true: an invalid primitive is an InputError, not left out
    int threads = 0;      // 0 to 1,024; 0, or more than the machine has: all it has. The tree does
                          // not depend on it
    int reinsertion_rounds = 0;  // after the build, 0 to 255, on the CPU only. Each round moves
                                 // large subtrees to cheaper places. Fewer than four rounds look
                                 // at less of the tree (docs/algorithms/reinsertion.md)
};

namespace detail {
[[noreturn]] void refuse_quality(int number);
}

/// Options that a quality stands for: `fast` is apetrei, `balanced` is ploc with 2 rounds of
/// reinsertion, `high` is sbvh with 4. Other options have their defaults. Throws InputError for a
/// number that is none of the three.
[[nodiscard]] constexpr BuildOptions build_options_for(Quality quality) {
    switch (quality) {
        case Quality::fast:
            return {.builder = Builder::apetrei};
        case Quality::balanced:
            return {.builder = Builder::ploc, .reinsertion_rounds = 2};
        case Quality::high:
            return {.builder = Builder::sbvh, .reinsertion_rounds = 4};
    }
    detail::refuse_quality(static_cast<int>(quality));
}

/// A node of 32 bytes. An inner node has count 0; its children are nodes `first` and `first + 1`. A
/// leaf has count > 0; its primitives stand at [first, first + count) of the order. In trees of the
/// LBVH family the left child has the lower codes, in all others the smallest primitive id. Slot 1
/// is padding, so that each pair of children lies in one line of 64 bytes. An inner node's `first`
/// is even and at least 2.
struct BvhNode {
    Vec3 lo;
    std::uint32_t first;
    Vec3 hi;
    std::uint32_t count;

    [[nodiscard]] constexpr bool is_leaf() const { return count != 0; }
};
static_assert(sizeof(BvhNode) == 32);

/// A triangle's three corners, copied into the order of leaves, so that a leaf lies in one piece.
template <class Scalar>
struct BasicLeafTriangle {
    BasicVec3<Scalar> v0, v1, v2;
};
using LeafTriangle = BasicLeafTriangle<float>;
using LeafTriangleD = BasicLeafTriangle<double>;
static_assert(sizeof(LeafTriangle) == 36 && sizeof(LeafTriangleD) == 72);

enum class PrimitiveKind : std::uint32_t { triangles = 0, boxes = 1, points = 2 };

/// Milliseconds of a build's stages. `layout` is the copy of the primitives into leaf order.
struct BuildMs {
    double bounds = 0, codes = 0, sort = 0, hierarchy = 0, fit = 0, layout = 0, total = 0;
};

/// A finished tree. Holds all that a trace reads; the mesh that it was built from may go. A tree
/// without valid primitives has no nodes; else nodes[0] is the root. Move-only. Any number of
/// threads may trace and ask one tree at once.
class Bvh {
public:
    [[nodiscard]] bool empty() const { return order_.empty(); }
    [[nodiscard]] std::span<const BvhNode> nodes() const { return nodes_.view(); }
    /// Position in leaf order -> the caller's primitive id, [references].
    [[nodiscard]] std::span<const std::uint32_t> order() const { return order_.view(); }
    /// Corners in leaf order, [references]; empty unless built from triangles.
    [[nodiscard]] std::span<const LeafTriangle> triangles() const { return triangles_.view(); }
    /// Boxes in leaf order, [references]; empty unless built from boxes.
    [[nodiscard]] std::span<const Aabb> boxes() const { return boxes_.view(); }
    /// Points in leaf order, [references]; empty unless built from points.
    [[nodiscard]] std::span<const Vec3> points() const { return points_.view(); }

    [[nodiscard]] PrimitiveKind kind() const { return kind_; }
    [[nodiscard]] const BuildOptions& options() const { return options_; }
    [[nodiscard]] std::uint32_t inner_count() const { return inner_count_; }
    [[nodiscard]] std::uint32_t leaf_count() const { return empty() ? 0 : inner_count_ + 1; }
    /// Edges from the root to the deepest leaf, exact. Traversal stacks are sized from it.
    [[nodiscard]] std::uint32_t max_depth() const { return max_depth_; }
    /// Primitives the caller gave, and how many of them were invalid and left out.
    [[nodiscard]] std::uint64_t input_count() const { return input_count_; }
    [[nodiscard]] std::uint64_t left_out() const { return left_out_; }
    /// Whether a primitive stands in more than one leaf, with a box around each part of it. Such a
    /// tree cannot be refitted: the parts are not kept.
    [[nodiscard]] bool has_split_primitives() const {
        return order_.size() != input_count_ - left_out_;
    }
    /// Whether the primitives have moved since the build (refit.h). A tree of the LBVH family is
    /// then no longer in the order of its Morton codes.
    [[nodiscard]] bool refitted() const { return refitted_; }
    [[nodiscard]] Aabb bounds() const;

    [[nodiscard]] const BuildMs& build_ms() const { return build_ms_; }
    /// Most bytes that the build held at once, tree included, above its input. 0 for a loaded tree.
    [[nodiscard]] std::uint64_t peak_bytes() const { return peak_bytes_; }
    /// Every byte a trace touches.
    [[nodiscard]] std::uint64_t bytes() const;

private:
    friend struct BvhInternals;  // builders and the file reader (src) fill the arrays through it
    Buffer<BvhNode> nodes_;
    Buffer<std::uint32_t> order_;
    Buffer<LeafTriangle> triangles_;
    Buffer<Aabb> boxes_;
    Buffer<Vec3> points_;
    PrimitiveKind kind_ = PrimitiveKind::triangles;
    BuildOptions options_;
    std::uint32_t inner_count_ = 0;
    std::uint32_t max_depth_ = 0;
    std::uint64_t input_count_ = 0;
    std::uint64_t left_out_ = 0;
    bool refitted_ = false;
    BuildMs build_ms_;
    std::uint64_t peak_bytes_ = 0;
};

/// Builds a tree over the mesh's triangles or, if it has none, over its vertices as points.
/// Triangles that are not finite or out of range (docs/contract.md 1) are left out and counted. The
/// tree names triangles by their position in the mesh. It does not depend on the number of threads.
/// Throws InputError: an option out of range, a vertex index past the end, 2^31 primitives or more;
/// with `options.strict` the first primitive that would be left out.
[[nodiscard]] Bvh build_bvh(const MeshView& mesh, const BuildOptions& options = {});
[[nodiscard]] Bvh build_bvh(const Mesh& mesh, const BuildOptions& options = {});

/// `options` with the builder and the rounds of reinsertion of the quality whose binary tree has
/// the least SAH (tree_stats), among `quality` and lower ones; of equals the better word's. So a
/// better word does not mean a higher cost, as for scenes. Where more than one may be the best,
/// their trees are built to find out, and InputError is thrown as by build_bvh. Of more than 1,024
/// triangles `fast` is not built to compare: it is better on few meshes, such as thousands of
/// triangles that lie one around the other.
[[nodiscard]] BuildOptions best_build_options(const MeshView& mesh, Quality quality,
                                              const BuildOptions& options = {});

/// Builds a tree over `boxes`. Boxes that are empty (lo > hi), not finite or out of range are left
/// out and counted. Such a tree answers overlapping_pairs (pairs.h), within itself and with a tree
/// over boxes to look for. Rays and distances take triangles or, with boxes around them, user
/// geometry of a Scene (user_geometry.h). Errors as above.
[[nodiscard]] Bvh build_bvh(std::span<const Aabb> boxes, const BuildOptions& options = {});

/// Builds a tree over points. Points that are not finite or out of range are left out and counted.
/// Errors as above.
[[nodiscard]] Bvh build_bvh(std::span<const Vec3> points, const BuildOptions& options = {});

/// Builds again and again into the same memory. Scratch is kept from one call to the next, and so
/// are the arrays of the tree if they are large enough. Not for use by two threads at once. The
/// boxes and points that a tree is built from may be those of `tree` itself.
class BvhBuilder {
public:
    BvhBuilder();
    ~BvhBuilder();
    BvhBuilder(BvhBuilder&&) noexcept;
    BvhBuilder& operator=(BvhBuilder&&) noexcept;

    /// As build_bvh, into `tree`.
    void build(const MeshView& mesh, const BuildOptions& options, Bvh& tree);
    void build(std::span<const Aabb> boxes, const BuildOptions& options, Bvh& tree);

private:
    friend struct BvhBuilderInternals;  // for builders that go on where this one would end
    struct Scratch;
    Scratch& scratch();
    std::unique_ptr<Scratch> scratch_;  // null: moved away
};

/// Many small trees in one call, as build_bvh makes them. A mesh is one thread's, so thousands of
/// them keep all threads busy. `peak_bytes` of each is 0. Throws InputError as build_bvh does,
/// naming the mesh: the first that a thread met.
[[nodiscard]] std::vector<Bvh> build_many(std::span<const MeshView> meshes,
                                          const BuildOptions& options = {});

/// Figures of the binary tree (docs/contract.md 2).
struct TreeStats {
    std::uint64_t nodes = 0;  // inner + leaves
    std::uint64_t leaves = 0;
    std::uint64_t references = 0;    // primitives in leaves
    std::uint64_t layout_nodes = 0;  // 32-byte slots of the node array, padding included
    std::uint32_t max_depth = 0;
    std::optional<std::uint32_t>
        depth_bound;            // code bits + ceil(log2 n): proven for the radix builders
    std::optional<double> sah;  // null if the root has no area
    SahConstants sah_constants;
    std::optional<double> epo;  // only if asked for
    std::uint64_t bytes = 0;
    std::uint64_t bytes_referenced = 0;  // of the caller's arrays that a trace reads: always 0
    std::string tree_hash;               // 32 hex digits
};

struct StatsOptions {
    SahConstants sah{};
    bool with_epo = false;
    double epo_sample = 1.0;  // part of the triangles that EPO sums over, evenly spread, in (0, 1]
    bool with_hash = true;
    int threads = 0;  // 0 to 1,024; 0: all the machine has
};

/// Walks the tree once for its statistics. SAH and EPO are sums in double, the same for every
/// thread count.
[[nodiscard]] TreeStats tree_stats(const Bvh& bvh, const StatsOptions& options = {});

/// A hash of nodes, order, boxes, bits and max_leaf, as 32 hex digits. Builder, device and threads
/// have no part in it. The bytes that are hashed: docs/contract.md 2.
[[nodiscard]] std::string tree_hash(const Bvh& bvh);

}  // namespace raydix
