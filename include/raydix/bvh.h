// Building bounding volume hierarchies.
#pragma once

#include <raydix/buffer.h>
#include <raydix/mesh.h>
#include <raydix/types.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace raydix {

/// `karras`, `lauterbach`, `garanzha` and `apetrei` give the same tree, bit for bit; `ploc` and
/// `hploc` merge clusters by surface area and `binned` splits by it; they give better ones for more
/// time. `sweep` looks at every split there is; `split` cuts large triangles into parts before, and
/// `sbvh` on the way, so that one triangle may be in several leaves. Over boxes and points both are
/// `sweep`.
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

/// How boxes are fitted: one launch per level from the deepest up, or one pass in which the second
/// child to arrive goes on. `as_published` is what the builder's source does. The boxes are the
/// same.
enum class Fit : std::uint32_t { as_published = 0, levels = 1, atomic = 2 };

/// Costs of the surface area heuristic: one inner node, one primitive of a leaf.
struct SahConstants {
    double node = 1.0;
    double primitive = 1.0;
};

struct BuildOptions {
    Builder builder = Builder::karras;
    int bits = 63;  // Morton code bits, 30 or 63; 30 sorts a little faster, but crowds large scenes
                    // into few cells
    int max_leaf =
        4;  // 1..255 primitives in a leaf; more means fewer nodes and more primitive tests
    Fit fit = Fit::as_published;
    bool strict = false;  // invalid primitives are an InputError instead of being left out
    int threads = 0;      // 0 to 1,024; 0, or more than the machine has: all it has. The tree does
                          // not depend on it
    int reinsertion_rounds =
        0;  // 0..255: so often, at most, large subtrees are then moved to better places; each round
            // costs 1 to 4 % of a build by sbvh or ploc, of small meshes up to 7 %, and up to 4
            // rounds make the part of the tree larger that is looked at. On the CPU only
};

/// What a tree is for: built each frame, built once for some million rays, built once for many.
enum class Quality { fast, balanced, high };

namespace detail {
[[noreturn]] void refuse_quality(int number);
}

/// What the word stands for: apetrei; ploc and 2 rounds of reinsertion; sbvh and 4. Other options
/// are as they are. Throws InputError for a number that is none of the three.
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

/// 32 bytes. Inner: count == 0, children are nodes `first` and `first + 1`, left = lower code
/// range, in trees with reinsertion the side of the smallest id. Leaf: count > 0 primitives,
/// positions [first, first + count) of the primitive order. Slot 1 is padding, so that each pair of
/// children lies in one 64-byte line; an inner node's `first` is even and >= 2.
struct BvhNode {
    Vec3 lo;
    std::uint32_t first;
    Vec3 hi;
    std::uint32_t count;

    [[nodiscard]] constexpr bool is_leaf() const { return count != 0; }
};
static_assert(sizeof(BvhNode) == 32);

/// A triangle's three corners, copied into leaf order so that a leaf is read in one run.
struct LeafTriangle {
    Vec3 v0, v1, v2;
};
static_assert(sizeof(LeafTriangle) == 36);

enum class PrimitiveKind : std::uint32_t { triangles = 0, boxes = 1, points = 2 };

/// Milliseconds of a build's stages. `layout` is the copy of the primitives into leaf order.
struct BuildMs {
    double bounds = 0, codes = 0, sort = 0, hierarchy = 0, fit = 0, layout = 0, total = 0;
};

/// A finished tree. Holds all that a trace reads (it does not refer to the mesh it was built from).
/// With n primitives left after invalid ones went: n = 0 has no nodes; else nodes[0] is the root.
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
    /// Whether a primitive may stand in more than one leaf, with a box around each part of it. Such
    /// a tree cannot be refitted: the parts are not kept.
    [[nodiscard]] bool has_split_primitives() const {
        return order_.size() != input_count_ - left_out_;
    }
    /// Whether the primitives have moved since the build (refit.h): a tree of the LBVH family is
    /// then no longer in the order of its Morton codes.
    [[nodiscard]] bool refitted() const { return refitted_; }
    [[nodiscard]] Aabb bounds() const;

    [[nodiscard]] const BuildMs& build_ms() const { return build_ms_; }
    /// Most bytes that the build held at once, tree included, above its input. 0 for a loaded tree.
    [[nodiscard]] std::uint64_t peak_bytes() const { return peak_bytes_; }
    /// Every byte a trace touches.
    [[nodiscard]] std::uint64_t bytes() const;

private:
    friend struct BvhAccess;  // builders and the file reader (src) fill the arrays through it
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

/// Builds a tree over the mesh's triangles; if it has none, over its vertices as points.
/// Triangles with a non-finite or out-of-range vertex are left out and counted; `options.strict`
/// throws instead. The tree refers to triangles by their position in the mesh. Same input, same
/// tree, for every thread count. Throws InputError: option out of range, a vertex index past the
/// end, 2^31 primitives or more.
[[nodiscard]] Bvh build_bvh(const MeshView& mesh, const BuildOptions& options = {});
[[nodiscard]] Bvh build_bvh(const Mesh& mesh, const BuildOptions& options = {});

/// Builds a tree over `boxes`. Boxes with lo > hi or a non-finite bound are left out and counted.
[[nodiscard]] Bvh build_bvh(std::span<const Aabb> boxes, const BuildOptions& options = {});

/// Builds a tree over points. Non-finite points are left out and counted.
[[nodiscard]] Bvh build_bvh(std::span<const Vec3> points, const BuildOptions& options = {});

/// Builds again and again into the same memory: scratch space and, if they are large enough, the
/// arrays of the tree are kept from one call to the next. Not for use by two threads at once.
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
    friend struct BvhBuilderAccess;  // for builders that go on where this one would end
    struct Scratch;
    std::unique_ptr<Scratch> scratch_;
};

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
    std::uint64_t bytes_referenced = 0;  // caller's buffers that a trace reads: none
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

/// 128 bits as hex over the canonical tree: equal exactly when topology, order and boxes are.
/// XXH3-128 (seed 0) of a little-endian byte stream: tree kind (uint32, 0 = bvh), bits, max_leaf
/// (uint32), then in preorder, left first, per node its six floats lo.xyz hi.xyz, per leaf also its
/// count and primitive ids (uint32).
[[nodiscard]] std::string tree_hash(const Bvh& bvh);

}  // namespace raydix
