// Numbers, node slots, leaf ranges, depth and order: the invariants that need no coordinates.
#include "tree/validate.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <vector>

#include "tree/lbvh_family.h"

namespace raydix {
namespace {

constexpr std::uint32_t padding_slot = 1;

Fault validate_options(const BuildOptions& options) {
    if (builder_name(options.builder) == "unknown")
        return fmt::format("info: builder number {} is unknown",
                           static_cast<std::uint32_t>(options.builder));
    if (options.bits != 30 && options.bits != 63)
        return fmt::format("info: {} code bits, not 30 or 63", options.bits);
    if (options.max_leaf < 1 || options.max_leaf > 255)
        return fmt::format("info: max_leaf {} is not in 1..255", options.max_leaf);
    if (options.reinsertion_rounds < 0 || options.reinsertion_rounds > 255)
        return fmt::format("info: {} rounds of reinsertion, not 0 to 255",
                           options.reinsertion_rounds);
    return {};
}

/// As many leaf primitives of the tree's kind as there are places in the order, and none of another
/// kind.
Fault validate_kind(const Bvh& bvh) {
    const std::size_t n = bvh.order().size();
    const auto wrong = [&](PrimitiveKind kind, std::size_t size) {
        return size != (bvh.kind() == kind ? n : 0);
    };
    const auto kind = static_cast<std::uint32_t>(bvh.kind());
    if (kind > static_cast<std::uint32_t>(PrimitiveKind::points))
        return fmt::format("info: primitive kind {} is unknown", kind);
    if (wrong(PrimitiveKind::triangles, bvh.triangles().size()) ||
        wrong(PrimitiveKind::boxes, bvh.boxes().size()) ||
        wrong(PrimitiveKind::points, bvh.points().size()))
        return fmt::format(
            "primitives: a tree of kind {} over {} references holds {} triangles, {} boxes, {} "
            "points",
            kind, n, bvh.triangles().size(), bvh.boxes().size(), bvh.points().size());
    return {};
}

/// One walk from the root. Each pair of slots may be entered once, so the walk ends.
class TopologyWalk {
public:
    explicit TopologyWalk(const Bvh& bvh) : bvh_(bvh), used_(bvh.nodes().size() / 2) {}

    Fault run() {
        waiting_.push_back({0, 0});
        while (!waiting_.empty()) {
            const Waiting next = waiting_.back();
            waiting_.pop_back();
            deepest_ = std::max(deepest_, next.depth);
            const bool leaf = bvh_.nodes()[next.node_index].is_leaf();
            if (Fault fault = leaf ? enter_leaf(next.node_index) : enter_inner(next)) return fault;
        }
        return at_end();
    }

private:
    struct Waiting {
        std::uint32_t node_index, depth;
    };

    Fault enter_leaf(std::uint32_t node_index) {
        const BvhNode& node = bvh_.nodes()[node_index];
        const std::size_t n = bvh_.order().size();
        if (node.count > static_cast<std::uint32_t>(bvh_.options().max_leaf))
            return fmt::format("nodes: leaf {} holds {} primitives, but max_leaf is {}", node_index,
                               node.count, bvh_.options().max_leaf);
        if (node.first != position_)
            return fmt::format(
                "nodes: leaf {} starts at position {}, but the leaves before it end at {}",
                node_index, node.first, position_);
        if (node.count > n - position_)
            return fmt::format("nodes: leaf {} holds positions [{}, {}), but the order ends at {}",
                               node_index, node.first, position_ + node.count, n);
        position_ += node.count;
        return {};
    }

    Fault enter_inner(const Waiting& entered) {
        const std::span<const BvhNode> nodes = bvh_.nodes();
        const std::uint32_t first = nodes[entered.node_index].first;
        if (first < 2 || first % 2 != 0)
            return fmt::format(
                "nodes: inner node {} has its children at slot {}, which is no pair's",
                entered.node_index, first);
        if (first >= nodes.size())
            return fmt::format("nodes: inner node {} has its children at slot {} of {}",
                               entered.node_index, first, nodes.size());
        if (used_[first / 2])
            return fmt::format(
                "nodes: inner node {} has its children at slot {}, which another node also has: a "
                "cycle "
                "or a shared subtree",
                entered.node_index, first);
        used_[first / 2] = true;
        ++inner_count_;
        waiting_.push_back({first + 1, entered.depth + 1});
        waiting_.push_back({first, entered.depth + 1});
        return {};
    }

    Fault at_end() const {
        if (position_ != bvh_.order().size())
            return fmt::format("nodes: the leaves hold {} primitives of {}", position_,
                               bvh_.order().size());
        for (std::size_t pair = 1; pair < used_.size(); ++pair)
            if (!used_[pair])
                return fmt::format("nodes: slots {} and {} are children of no node", 2 * pair,
                                   2 * pair + 1);
        if (inner_count_ != bvh_.inner_count())
            return fmt::format("info: {} inner nodes claimed, {} found", bvh_.inner_count(),
                               inner_count_);
        if (deepest_ != bvh_.max_depth())
            return fmt::format("info: depth {} claimed, but the deepest leaf is at {}",
                               bvh_.max_depth(), deepest_);
        return {};
    }

    const Bvh& bvh_;
    std::vector<bool> used_;  // pair of slots -> some node's children
    std::vector<Waiting> waiting_;
    std::size_t position_ = 0;
    std::uint64_t inner_count_ = 0;
    std::uint32_t deepest_ = 0;
};

/// Collapse takes the highest nodes that fit into a leaf, so no inner node would have fitted. A
/// node above such an inner node holds more, so the ones with two leaves decide.
Fault validate_collapse(const Bvh& bvh) {
    const std::span<const BvhNode> nodes = bvh.nodes();
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        if (nodes[i].is_leaf() || i == padding_slot) continue;
        const BvhNode& left = nodes[nodes[i].first];
        const BvhNode& right = nodes[nodes[i].first + 1];
        if (!left.is_leaf() || !right.is_leaf()) continue;
        const std::uint64_t count = std::uint64_t{left.count} + right.count;
        if (count <= static_cast<std::uint64_t>(bvh.options().max_leaf))
            return fmt::format("nodes: inner node {} holds only {} primitives, a leaf may hold {}",
                               i, count, bvh.options().max_leaf);
    }
    return {};
}

bool all_bits_zero(const BvhNode& node) {
    for (const float x : {node.lo.x, node.lo.y, node.lo.z, node.hi.x, node.hi.y, node.hi.z})
        if (std::bit_cast<std::uint32_t>(x) != 0) return false;
    return node.first == 0 && node.count == 0;
}

/// How many primitives the order names, and one that it names twice.
struct Named {
    std::uint64_t distinct = 0;
    std::optional<std::uint32_t> repeated;
};

/// For few references to a long list of primitives.
Named named_by_sorting(std::span<const std::uint32_t> order) {
    std::vector<std::uint32_t> sorted(order.begin(), order.end());
    std::sort(sorted.begin(), sorted.end());
    Named named;
    for (std::size_t i = 0; i < sorted.size(); ++i) {
        if (i == 0 || sorted[i] != sorted[i - 1])
            ++named.distinct;
        else if (!named.repeated)
            named.repeated = sorted[i];
    }
    return named;
}

Named named_by_marking(std::span<const std::uint32_t> order, std::uint64_t input_count) {
    std::vector<bool> seen(input_count);
    Named named;
    for (const std::uint32_t primitive_id : order) {
        if (!seen[primitive_id])
            ++named.distinct;
        else if (!named.repeated)
            named.repeated = primitive_id;
        seen[primitive_id] = true;
    }
    return named;
}

/// Ids within a leaf ascend, so that none stands there twice.
Fault validate_leaf_ids(const Bvh& bvh) {
    const std::span<const std::uint32_t> order = bvh.order();
    for (std::size_t i = 0; i < bvh.nodes().size(); ++i) {
        const BvhNode& node = bvh.nodes()[i];
        for (std::uint32_t k = 1; k < node.count; ++k)
            if (order[node.first + k - 1] >= order[node.first + k])
                return fmt::format("order: leaf {} holds primitive {} behind {}", i,
                                   order[node.first + k], order[node.first + k - 1]);
    }
    return {};
}

}  // namespace

Fault validate_counts(const Bvh& bvh) {
    if (Fault fault = validate_options(bvh.options())) return fault;
    if (Fault fault = validate_kind(bvh)) return fault;
    const std::uint64_t n = bvh.order().size();
    if (bvh.input_count() >= primitive_limit)
        return fmt::format("info: {} primitives, more than a tree can hold", bvh.input_count());
    const std::uint64_t valid = bvh.input_count() - bvh.left_out();
    const bool fits = may_split_primitives(bvh)
                          ? n < primitive_limit && n >= valid && (n == 0) == (valid == 0)
                          : n == valid;
    if (bvh.left_out() > bvh.input_count() || !fits)
        return fmt::format("info: {} primitives, {} left out, but {} references", bvh.input_count(),
                           bvh.left_out(), n);
    if (bvh.refitted() && bvh.has_split_primitives())
        return fmt::format(
            "info: {} references to {} primitives, and refitted; parts of primitives "
            "cannot be",
            n, valid);
    const std::uint64_t slots = n == 0 ? 0 : 2 * std::uint64_t{bvh.inner_count()} + 2;
    if (bvh.nodes().size() != slots)
        return fmt::format("nodes: {} slots, but {} inner nodes over {} primitives need {}",
                           bvh.nodes().size(), bvh.inner_count(), n, slots);
    if (n == 0 && (bvh.inner_count() != 0 || bvh.max_depth() != 0))
        return fmt::format("info: an empty tree claims {} inner nodes and depth {}",
                           bvh.inner_count(), bvh.max_depth());
    return {};
}

Fault validate_topology(const Bvh& bvh) {
    if (bvh.nodes().empty()) return {};
    if (Fault fault = TopologyWalk(bvh).run()) return fault;
    if (!all_bits_zero(bvh.nodes()[padding_slot]))
        return fmt::format("nodes: slot {} is padding, but not zero", padding_slot);
    if (!follows_codes(bvh.options())) return {};
    const std::uint32_t bound = lbvh_depth_bound(bvh.options().bits, bvh.order().size());
    if (bvh.max_depth() > bound)
        return fmt::format(
            "info: depth {} is beyond {}, the bound for {} primitives and {} code bits",
            bvh.max_depth(), bound, bvh.order().size(), bvh.options().bits);
    return validate_collapse(bvh);
}

Fault validate_order(const Bvh& bvh) {
    const std::span<const std::uint32_t> order = bvh.order();
    for (std::size_t i = 0; i < order.size(); ++i)
        if (order[i] >= bvh.input_count())
            return fmt::format("order: position {} names primitive {} of {}", i, order[i],
                               bvh.input_count());
    // A mark costs a bit, a sorted copy four bytes: either way memory follows the arrays that are
    // there.
    const Named named = bvh.input_count() / 32 > order.size()
                            ? named_by_sorting(order)
                            : named_by_marking(order, bvh.input_count());
    if (may_split_primitives(bvh)) {
        if (named.distinct != bvh.input_count() - bvh.left_out())
            return fmt::format("order: {} primitives, {} left out, but the leaves hold {}",
                               bvh.input_count(), bvh.left_out(), named.distinct);
        return validate_leaf_ids(bvh);
    }
    if (named.repeated)
        return fmt::format("order: primitive {} stands in more than one place", *named.repeated);
    return {};
}

Fault validate(const Bvh& bvh, const MeshView* mesh) {
    if (Fault fault = validate_counts(bvh)) return fault;
    if (mesh)
        if (Fault fault = validate_mesh_counts(bvh, *mesh)) return fault;
    if (Fault fault = validate_topology(bvh)) return fault;
    if (Fault fault = validate_order(bvh)) return fault;
    if (Fault fault = validate_primitives(bvh)) return fault;
    if (Fault fault = validate_boxes(bvh)) return fault;
    if (Fault fault = validate_cover(bvh)) return fault;
    if (Fault fault = validate_codes(bvh)) return fault;
    return mesh ? validate_against_mesh(bvh, *mesh) : Fault{};
}

}  // namespace raydix
