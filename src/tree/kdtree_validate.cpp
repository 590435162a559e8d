// Numbers, slots, leaf ranges, depth and primitives of a k-d tree: what needs no codes.
#include "tree/kdtree_validate.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <vector>

#include "base/math.h"
#include "base/same_bits.h"
#include "exec/search.h"
#include "tree/lbvh_family.h"

namespace raydix {
namespace {

/// One walk from the root. Each pair of slots may be entered once, so the walk ends.
class KdTopologyWalk {
public:
    explicit KdTopologyWalk(const KdTree& tree) : tree_(tree), used_(tree.nodes().size() / 2) {}

    Fault run() {
        waiting_.push_back({0, 0});
        while (!waiting_.empty()) {
            const Waiting next = waiting_.back();
            waiting_.pop_back();
            deepest_ = std::max(deepest_, next.depth);
            const bool leaf = tree_.nodes()[next.slot].is_leaf();
            if (Fault fault = leaf ? enter_leaf(next.slot) : enter_inner(next)) return fault;
        }
        return at_end();
    }

private:
    struct Waiting {
        std::uint32_t slot, depth;
    };

    Fault enter_leaf(std::uint32_t slot) {
        const KdNode& node = tree_.nodes()[slot];
        const std::size_t n = tree_.order().size();
        if (node.count() == 0 || node.count() > static_cast<std::uint32_t>(max_leaf()))
            return fmt::format("nodes: leaf {} holds {} primitives, but max_leaf is {}", slot,
                               node.count(), max_leaf());
        if (node.first != position_)
            return fmt::format(
                "nodes: leaf {} starts at position {}, but the leaves before it end at {}", slot,
                node.first, position_);
        if (node.count() > n - position_)
            return fmt::format("nodes: leaf {} holds positions [{}, {}), but the order ends at {}",
                               slot, node.first, position_ + node.count(), n);
        position_ += node.count();
        return {};
    }

    Fault enter_inner(const Waiting& entered) {
        const std::span<const KdNode> nodes = tree_.nodes();
        // In 64 bits: what a broken link says may wrap around in 32.
        const std::uint64_t child = std::uint64_t{nodes[entered.slot].link >> 2} * 2 + 2;
        if (child >= nodes.size())
            return fmt::format("nodes: inner node {} has its children at slot {} of {}",
                               entered.slot, child, nodes.size());
        if (used_[child / 2])
            return fmt::format(
                "nodes: inner node {} has its children at slot {}, which another node also has: a "
                "cycle or a shared subtree",
                entered.slot, child);
        used_[child / 2] = true;
        const auto left = static_cast<std::uint32_t>(child);
        if (nodes[left].is_leaf() && nodes[left + 1].is_leaf()) {
            const std::uint64_t count =
                std::uint64_t{nodes[left].count()} + nodes[left + 1].count();
            if (count <= static_cast<std::uint64_t>(max_leaf()))
                return fmt::format(
                    "nodes: inner node {} holds only {} primitives, a leaf may hold {}",
                    entered.slot, count, max_leaf());
        }
        ++inner_count_;
        waiting_.push_back({left + 1, entered.depth + 1});
        waiting_.push_back({left, entered.depth + 1});
        return {};
    }

    [[nodiscard]] Fault at_end() const {
        if (position_ != tree_.order().size())
            return fmt::format("nodes: the leaves hold {} primitives of {}", position_,
                               tree_.order().size());
        if (inner_count_ != tree_.inner_count())
            return fmt::format("info: {} inner nodes claimed, {} found", tree_.inner_count(),
                               inner_count_);
        if (deepest_ != tree_.max_depth())
            return fmt::format("info: depth {} claimed, but the deepest leaf is at {}",
                               tree_.max_depth(), deepest_);
        return {};
    }
    [[nodiscard]] int max_leaf() const { return tree_.options().max_leaf; }

    const KdTree& tree_;
    std::vector<bool> used_;  // pair of slots -> some node's children
    std::vector<Waiting> waiting_;
    std::size_t position_ = 0;
    std::uint64_t inner_count_ = 0;
    std::uint32_t deepest_ = 0;
};

bool is_clean_primitive(const KdTree& tree, std::size_t position) {
    if (tree.kind() == PrimitiveKind::points) return is_clean(tree.points()[position]);
    const LeafTriangle& t = tree.triangles()[position];
    return is_clean(t.v0) && is_clean(t.v1) && is_clean(t.v2) &&
           diagonal_in_range(box_of(t.v0, t.v1, t.v2));
}

bool matches_mesh(const KdTree& tree, const MeshView& mesh, std::size_t position) {
    const auto vertex = [&](std::uint32_t i) { return without_negative_zero(mesh.vertices[i]); };
    const std::uint32_t id = tree.order()[position];
    if (tree.kind() == PrimitiveKind::points) return same_bits(tree.points()[position], vertex(id));
    const Triangle& corners = mesh.triangles[id];
    const LeafTriangle& t = tree.triangles()[position];
    return same_bits(t.v0, vertex(corners[0])) && same_bits(t.v1, vertex(corners[1])) &&
           same_bits(t.v2, vertex(corners[2]));
}

/// The lowest primitive that the tree leaves out for no reason, or the number of primitives.
std::size_t first_missing(const KdTree& tree, const MeshView& mesh) {
    std::vector<bool> held(tree.input_count());
    for (const std::uint32_t id : tree.order()) held[id] = true;
    return first_index_where(held.size(), [&](std::size_t i) {
        if (held[i]) return false;
        if (tree.kind() == PrimitiveKind::points) return in_range(mesh.vertices[i]);
        const Triangle& t = mesh.triangles[i];
        const Vec3 a = mesh.vertices[t[0]], b = mesh.vertices[t[1]], c = mesh.vertices[t[2]];
        return in_range(a) && in_range(b) && in_range(c) && diagonal_in_range(box_of(a, b, c));
    });
}

}  // namespace

Aabb kd_primitive_box(const KdTree& tree, std::size_t position) {
    if (tree.kind() == PrimitiveKind::points)
        return {tree.points()[position], tree.points()[position]};
    const LeafTriangle& t = tree.triangles()[position];
    return box_of(t.v0, t.v1, t.v2);
}

Fault validate_kd_counts(const KdTree& tree) {
    const KdTreeOptions& options = tree.options();
    if (options.bits != 30 && options.bits != 63)
        return fmt::format("info: {} code bits, not 30 or 63", options.bits);
    if (options.max_leaf < 1 || options.max_leaf > 255)
        return fmt::format("info: max_leaf {} is not in 1..255", options.max_leaf);
    const std::uint64_t n = tree.order().size();
    const bool points = tree.kind() == PrimitiveKind::points;
    if (!points && tree.kind() != PrimitiveKind::triangles)
        return fmt::format("info: primitive kind {} goes into no k-d tree",
                           static_cast<std::uint32_t>(tree.kind()));
    if (tree.points().size() != (points ? n : 0) || tree.triangles().size() != (points ? 0 : n))
        return fmt::format("primitives: {} references to {} points and {} triangles", n,
                           tree.points().size(), tree.triangles().size());
    if (tree.input_count() >= primitive_limit)
        return fmt::format("info: {} primitives, more than a tree can hold", tree.input_count());
    if (tree.left_out() > tree.input_count() || tree.input_count() - tree.left_out() != n)
        return fmt::format("info: {} primitives, {} left out, but {} references",
                           tree.input_count(), tree.left_out(), n);
    const std::uint64_t slots = n == 0 ? 0 : 2 * std::uint64_t{tree.inner_count()} + 2;
    if (tree.nodes().size() != slots)
        return fmt::format("nodes: {} slots, but {} inner nodes over {} primitives need {}",
                           tree.nodes().size(), tree.inner_count(), n, slots);
    if (n == 0 && (tree.inner_count() != 0 || tree.max_depth() != 0))
        return fmt::format("info: an empty tree claims {} inner nodes and depth {}",
                           tree.inner_count(), tree.max_depth());
    return {};
}

Fault validate_kd_topology(const KdTree& tree) {
    if (tree.nodes().empty()) return {};
    if (Fault fault = KdTopologyWalk(tree).run()) return fault;
    const std::uint32_t bound = lbvh_depth_bound(tree.options().bits, tree.order().size());
    if (tree.max_depth() > bound)
        return fmt::format(
            "info: depth {} is beyond {}, the bound for {} primitives and {} code bits",
            tree.max_depth(), bound, tree.order().size(), tree.options().bits);
    const auto zero = [](float x) { return std::bit_cast<std::uint32_t>(x) == 0; };
    const KdNode &root = tree.nodes()[0], &padding = tree.nodes()[1];
    if (!zero(root.lo) || !zero(root.hi))
        return fmt::format("nodes: the root's interval is [{}, {}], not 0", root.lo, root.hi);
    if (!zero(padding.lo) || !zero(padding.hi) || padding.first != 0 || padding.link != 0)
        return "nodes: slot 1 is padding, but not zero";
    return {};
}

Fault validate_kd_primitives(const KdTree& tree) {
    std::vector<bool> seen(tree.input_count());
    for (std::size_t i = 0; i < tree.order().size(); ++i) {
        const std::uint32_t id = tree.order()[i];
        if (id >= tree.input_count())
            return fmt::format("order: position {} names primitive {} of {}", i, id,
                               tree.input_count());
        if (seen[id]) return fmt::format("order: primitive {} stands in more than one place", id);
        seen[id] = true;
    }
    const std::size_t n = tree.order().size();
    const std::size_t bad =
        first_index_where(n, [&](std::size_t i) { return !is_clean_primitive(tree, i); });
    if (bad != n)
        return fmt::format(
            "primitives: the one at position {} belongs in no tree (not finite, out of range or "
            "-0)",
            bad);
    Aabb box = empty_box();
    for (std::size_t i = 0; i < n; ++i) box = unite(box, kd_primitive_box(tree, i));
    if (!same_bits(box.lo, tree.bounds().lo) || !same_bits(box.hi, tree.bounds().hi))
        return "info: the bounds are not the box around all primitives";
    return {};
}

Fault validate_kd_mesh(const KdTree& tree, const MeshView& mesh) {
    const bool points = tree.kind() == PrimitiveKind::points;
    if (points && !mesh.triangles.empty())
        return fmt::format("triangles: a tree of points, but a mesh with {} triangles",
                           mesh.triangles.size());
    const std::size_t count = points ? mesh.vertices.size() : mesh.triangles.size();
    if (tree.input_count() != count)
        return fmt::format("info: a tree built from {} {}, but a mesh with {}", tree.input_count(),
                           points ? "points" : "triangles", count);
    for (const Triangle& t : mesh.triangles)
        if (std::max({t[0], t[1], t[2]}) >= mesh.vertices.size())
            return fmt::format("triangles: a vertex {} of {}", std::max({t[0], t[1], t[2]}),
                               mesh.vertices.size());
    const std::size_t n = tree.order().size();
    const std::size_t bad =
        first_index_where(n, [&](std::size_t i) { return !matches_mesh(tree, mesh, i); });
    if (bad != n)
        return fmt::format(
            "primitives: the one at position {} is not what the mesh holds as number {}", bad,
            tree.order()[bad]);
    const std::size_t missing = first_missing(tree, mesh);
    if (missing != tree.input_count())
        return fmt::format("order: primitive {} is left out, though nothing is wrong with it",
                           missing);
    return {};
}

Fault validate_kd(const KdTree& tree, const MeshView* mesh) {
    if (Fault fault = validate_kd_counts(tree)) return fault;
    if (Fault fault = validate_kd_topology(tree)) return fault;
    if (Fault fault = validate_kd_primitives(tree)) return fault;
    if (Fault fault = validate_kd_splits(tree)) return fault;
    if (Fault fault = validate_kd_intervals(tree)) return fault;
    return mesh ? validate_kd_mesh(tree, *mesh) : Fault{};
}

}  // namespace raydix
