// The invariants of an octree's nodes, and the public check.
#include "tree/octree_validate.h"

#include <fmt/format.h>

#include "base/math.h"
#include "exec/parallel.h"
#include "exec/search.h"

namespace raydix {
namespace {

template <class... Values>
Fault node_fault(std::size_t node, fmt::format_string<Values...> reason, Values&&... values) {
    return fmt::format("nodes: node {}: {}", node,
                       fmt::format(reason, std::forward<Values>(values)...));
}

/// The fault of the lowest-numbered node that has one.
template <class FaultOf>
Fault first_node_fault(const Octree& octree, const FaultOf& fault_of) {
    const std::size_t n = octree.nodes().size();
    const std::size_t first =
        first_index_where(n, [&](std::size_t i) { return fault_of(i).has_value(); });
    return first == n ? Fault{} : fault_of(first);
}

}  // namespace

Fault validate_counts(const Octree& octree) {
    const OctreeOptions& o = octree.options();
    if (o.bits != 30 && o.bits != 63) return fmt::format("info: {} code bits", o.bits);
    if (o.max_level < 0 || o.max_level > o.bits / 3)
        return fmt::format("info: max_level {} with {} bits", o.max_level, o.bits);
    if (o.max_leaf < 1) return fmt::format("info: max_leaf {}", o.max_leaf);
    if (octree.kind() == PrimitiveKind::boxes) return "info: an octree of boxes";
    if (octree.order().size() + octree.left_out() != octree.input_count())
        return fmt::format("info: {} primitives in the tree and {} left out of {}",
                           octree.order().size(), octree.left_out(), octree.input_count());
    if (octree.points().size() != octree.order().size())
        return fmt::format("points: {} for {} primitives", octree.points().size(),
                           octree.order().size());
    if (octree.nodes().empty() != octree.order().empty())
        return fmt::format("nodes: {} for {} primitives", octree.nodes().size(),
                           octree.order().size());
    if (!octree.empty() && (!in_range(octree.bounds().lo) || !in_range(octree.bounds().hi) ||
                            is_empty(octree.bounds())))
        return "info: the scene's bounds are no box";
    return {};
}

/// Levels follow each other, and each one's nodes ascend by code.
Fault validate_levels(const Octree& octree) {
    const std::span<const OctreeNode> nodes = octree.nodes();
    if (octree.empty()) return {};
    if (nodes[0].level != 0) return node_fault(0, "the root is at level {}", nodes[0].level);
    const auto max_level = static_cast<std::uint32_t>(octree.options().max_level);
    Fault fault = first_node_fault(octree, [&](std::size_t i) -> Fault {
        const OctreeNode& node = nodes[i];
        if (node.level > max_level)
            return node_fault(i, "level {} is past max_level {}", node.level, max_level);
        if (node.code >> (3 * node.level) != 0)
            return node_fault(i, "code {:#x} is not one of level {}", node.code, node.level);
        if (i == 0) return {};
        const OctreeNode& before = nodes[i - 1];
        if (node.level != before.level && node.level != before.level + 1)
            return node_fault(i, "level {} follows level {}", node.level, before.level);
        if (node.level == before.level && node.code <= before.code)
            return node_fault(i, "code {:#x} follows {:#x} on level {}", node.code, before.code,
                              node.level);
        return {};
    });
    if (fault) return fault;
    std::uint32_t node = 0;
    for (std::uint32_t level = 0; level < octree.level_count(); ++level) {
        const NodeRange range = octree.level_nodes(level);
        if (range.begin != node || range.end <= node || range.end > nodes.size() ||
            nodes[range.begin].level != level || nodes[range.end - 1].level != level)
            return fmt::format("info: level {} is said to be nodes {} to {}", level, range.begin,
                               range.end);
        node = range.end;
    }
    return {};
}

/// Every node but the root is the child of one node; codes and point ranges of children are parts
/// of their parent's.
Fault validate_children(const Octree& octree) {
    const std::span<const OctreeNode> nodes = octree.nodes();
    if (octree.empty()) return {};
    const OctreeNode& root = nodes[0];
    if (root.parent != no_node) return node_fault(0, "the root has parent {}", root.parent);
    if (root.first_point != 0 || root.point_count != octree.order().size())
        return node_fault(0, "points {} + {} of {}", root.first_point, root.point_count,
                          octree.order().size());
    std::uint64_t next_child = 1;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        const OctreeNode& node = nodes[i];
        if (node.point_count == 0) return node_fault(i, "no points");
        if (node.child_mask > 0xFF) return node_fault(i, "child mask {:#x}", node.child_mask);
        if (node.is_leaf()) {
            if (node.first_child != no_node)
                return node_fault(i, "a leaf with first child {}", node.first_child);
            continue;
        }
        if (node.first_child != next_child)
            return node_fault(i, "first child {} where {} comes next", node.first_child,
                              next_child);
        std::uint64_t point = node.first_point;
        for (std::uint32_t octant = 0; octant < 8; ++octant) {
            if ((node.child_mask >> octant & 1u) == 0) continue;
            if (next_child >= nodes.size())
                return node_fault(i, "child {} of {} nodes", next_child, nodes.size());
            const OctreeNode& child = nodes[next_child];
            if (child.parent != i)
                return node_fault(next_child, "parent {}, not {}", child.parent, i);
            if (child.level != node.level + 1 || child.code != (node.code << 3 | octant))
                return node_fault(next_child, "code {:#x} in octant {} of code {:#x}", child.code,
                                  octant, node.code);
            if (child.first_point != point)
                return node_fault(next_child, "points from {}, not {}", child.first_point, point);
            point += child.point_count;
            ++next_child;
        }
        if (point != std::uint64_t{node.first_point} + node.point_count)
            return node_fault(i, "points up to {}, its children's up to {}",
                              std::uint64_t{node.first_point} + node.point_count, point);
    }
    if (next_child != nodes.size()) return node_fault(next_child, "in no node's children");
    return {};
}

/// Divided exactly if there are more than max_leaf points and the level allows it.
Fault validate_division(const Octree& octree) {
    const auto max_leaf = static_cast<std::uint32_t>(octree.options().max_leaf);
    const auto max_level = static_cast<std::uint32_t>(octree.options().max_level);
    return first_node_fault(octree, [&](std::size_t i) -> Fault {
        const OctreeNode& node = octree.nodes()[i];
        const bool divides = node.point_count > max_leaf && node.level < max_level;
        if (divides == !node.is_leaf()) return {};
        return node_fault(i, "{} with {} points at level {}; max_leaf {}, max_level {}",
                          node.is_leaf() ? "a leaf" : "divided", node.point_count, node.level,
                          max_leaf, max_level);
    });
}

Fault validate(const Octree& octree, const MeshView* mesh) {
    if (Fault f = validate_counts(octree)) return f;
    if (Fault f = validate_levels(octree)) return f;
    if (Fault f = validate_children(octree)) return f;
    if (Fault f = validate_division(octree)) return f;
    if (Fault f = validate_order(octree)) return f;
    if (Fault f = validate_cells(octree)) return f;
    return mesh != nullptr ? validate_against_mesh(octree, *mesh) : Fault{};
}

namespace {

CheckReport report(const Octree& octree, const MeshView* mesh) {
    CheckReport result;
    with_threads(0, [&] {
        if (Fault fault = validate(octree, mesh)) {
            result.ok = false;
            result.broken = *std::move(fault);
        }
    });
    result.nodes = octree.nodes().size();
    result.primitives = octree.order().size();
    return result;
}

}  // namespace

CheckReport check(const Octree& octree) { return report(octree, nullptr); }
CheckReport check(const Octree& octree, const MeshView& mesh) { return report(octree, &mesh); }

}  // namespace raydix
