// The geometry of a k-d tree, computed again: codes ascend along the order, each inner node splits
// where its codes first differ, at that axis and plane, the plane parts the centres, and intervals
// are tight.
#include <fmt/format.h>

#include <vector>

#include "base/same_bits.h"
#include "exec/search.h"
#include "tree/kdtree.h"
#include "tree/kdtree_validate.h"
#include "tree/kdtree_walk.h"

namespace raydix {
namespace {

/// Slot -> positions [begin, end) below it.
struct Range {
    std::uint32_t begin = 0, end = 0;
};

/// Slots in preorder: read backward, children come before their parents.
std::vector<std::uint32_t> preorder_of(const KdTree& tree) {
    std::vector<std::uint32_t> order;
    order.reserve(tree.nodes().size());
    walk_kd_preorder(tree.nodes(), tree.max_depth(),
                     [&](std::uint32_t slot) { order.push_back(slot); });
    return order;
}

std::vector<Range> ranges_of(const KdTree& tree) {
    std::vector<Range> ranges(tree.nodes().size());
    const std::vector<std::uint32_t> order = preorder_of(tree);
    for (auto slot = order.rbegin(); slot != order.rend(); ++slot) {
        const KdNode& node = tree.nodes()[*slot];
        ranges[*slot] = node.is_leaf()
                            ? Range{node.first, node.first + node.count()}
                            : Range{ranges[node.child()].begin, ranges[node.child() + 1].end};
    }
    return ranges;
}

Vec3 center_at(const KdTree& tree, std::size_t position) {
    return center_of(kd_primitive_box(tree, position));
}

template <class Key>
struct SplitCheck {
    const KdTree& tree;
    Grid grid;
    std::vector<Key> codes;
    std::vector<Range> ranges;

    explicit SplitCheck(const KdTree& t)
        : tree(t),
          grid(make_grid(t.bounds(), CodeFormat<Key>::axis_bits)),
          codes(t.order().size()),
          ranges(ranges_of(t)) {
        for_each_index(codes.size(), [&](std::size_t i) {
            codes[i] = interleave<Key>(grid.cell(center_at(tree, i)));
        });
    }

    [[nodiscard]] Fault order_fault() const {
        const std::span<const std::uint32_t> order = tree.order();
        const std::size_t pairs = codes.size() - 1;
        const std::size_t falls = first_index_where(pairs, [&](std::size_t i) {
            return codes[i] != codes[i + 1] ? codes[i] > codes[i + 1] : order[i] >= order[i + 1];
        });
        if (falls == pairs) return {};
        return fmt::format(
            "order: positions {} and {} with the codes {:#x} and {:#x} and the primitives {} and "
            "{} do not ascend",
            falls, falls + 1, codes[falls], codes[falls + 1], order[falls], order[falls + 1]);
    }

    [[nodiscard]] Fault fault_of(std::uint32_t slot) const {
        const KdNode& node = tree.nodes()[slot];
        if (slot == 1 || node.is_leaf()) return {};
        const SortedKeys<Key> keys{codes.data(), static_cast<std::uint32_t>(codes.size())};
        const std::uint32_t first = ranges[slot].begin, last = ranges[slot].end - 1;
        const std::uint32_t middle = ranges[node.child() + 1].begin;
        const int prefix = keys.common_prefix(first, last);
        if (keys.common_prefix(first, middle - 1) <= prefix && first != middle - 1)
            return fmt::format(
                "nodes: the left side of inner node {} ends at {}, not where codes "
                "first differ",
                slot, middle);
        if (keys.common_prefix(middle, last) <= prefix && middle != last)
            return fmt::format(
                "nodes: the right side of inner node {} starts at {}, not where "
                "codes first differ",
                slot, middle);
        const KdSplit split = split_of_prefix<Key>(grid, codes[middle], prefix);
        if (node.axis() != split.axis)
            return fmt::format("nodes: inner node {} splits axis {}, but its codes differ on {}",
                               slot, node.axis(), split.axis);
        if (!same_bits(node.plane, split.plane))
            return fmt::format("nodes: inner node {} splits at {}, but its codes differ at {}",
                               slot, node.plane, split.plane);
        return parting_fault(slot, middle);
    }

    /// The plane, held against the two centres next to it in the order of codes. All of a side lie
    /// in cells on that side, so these two stand for it together with the checks above.
    [[nodiscard]] Fault parting_fault(std::uint32_t slot, std::uint32_t middle) const {
        const KdNode& node = tree.nodes()[slot];
        if (node.splits_equal_codes()) return {};
        const float left = component_of(center_at(tree, middle - 1), node.axis());
        const float right = component_of(center_at(tree, middle), node.axis());
        if (left < node.plane && node.plane <= right) return {};
        return fmt::format("nodes: the plane {} of inner node {} does not part {} and {}",
                           node.plane, slot, left, right);
    }
};

template <class Key>
Fault splits_fault(const KdTree& tree) {
    const SplitCheck<Key> check(tree);
    if (Fault fault = check.order_fault()) return fault;
    const std::size_t slots = tree.nodes().size();
    const std::size_t bad = first_index_where(slots, [&](std::size_t slot) {
        return check.fault_of(static_cast<std::uint32_t>(slot)).has_value();
    });
    return bad == slots ? Fault{} : check.fault_of(static_cast<std::uint32_t>(bad));
}

CheckReport report(const KdTree& tree, const MeshView* mesh) {
    CheckReport result;
    with_threads(0, [&] {
        if (Fault fault = validate_kd(tree, mesh)) {
            result.ok = false;
            result.broken = *std::move(fault);
        }
    });
    result.nodes = std::uint64_t{tree.inner_count()} + tree.leaf_count();
    result.primitives = tree.order().size();
    return result;
}

}  // namespace

Fault validate_kd_splits(const KdTree& tree) {
    if (tree.empty()) return {};
    return tree.options().bits == 30 ? splits_fault<std::uint32_t>(tree)
                                     : splits_fault<std::uint64_t>(tree);
}

Fault validate_kd_intervals(const KdTree& tree) {
    std::vector<Aabb> boxes(tree.nodes().size(), empty_box());
    const std::vector<std::uint32_t> order = preorder_of(tree);
    for (auto slot = order.rbegin(); slot != order.rend(); ++slot) {
        const KdNode& node = tree.nodes()[*slot];
        if (node.is_leaf()) {
            for (std::uint32_t i = node.first; i < node.first + node.count(); ++i)
                boxes[*slot] = unite(boxes[*slot], kd_primitive_box(tree, i));
            continue;
        }
        boxes[*slot] = unite(boxes[node.child()], boxes[node.child() + 1]);
        for (const std::uint32_t child : {node.child(), node.child() + 1}) {
            const float lo = component_of(boxes[child].lo, node.axis()),
                        hi = component_of(boxes[child].hi, node.axis());
            const KdNode& side = tree.nodes()[child];
            if (!same_bits(side.lo, lo) || !same_bits(side.hi, hi))
                return fmt::format(
                    "nodes: the interval of node {} is [{}, {}], but what it holds spans [{}, {}]",
                    child, side.lo, side.hi, lo, hi);
        }
    }
    return {};
}

CheckReport kd_check(const KdTree& tree) { return report(tree, nullptr); }
CheckReport kd_check(const KdTree& tree, const MeshView& mesh) { return report(tree, &mesh); }

}  // namespace raydix
