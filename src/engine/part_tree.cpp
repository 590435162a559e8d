#include "engine/part_tree.h"

#include <algorithm>

#include "exec/parallel.h"
#include "layout/wide_collapse.h"

namespace raydix {
namespace {

/// Where a line is as floats have it: their roundings are 2^-24 of its origin and of the way to the
/// part, twice as much with what is to spare.
constexpr double float_rounding = 0x1p-22;

/// Builders leave out boxes beyond the range of coordinates. Extents of meshes at its edge reach
/// less than 2^-21 of it farther: they are built to the edge, and nodes there reach farther again.
Aabb built_box(const Extent& extent) {
    constexpr Vec3 edge{max_coordinate, max_coordinate, max_coordinate};
    return {max_of(extent.box.lo, edge * -1.0f), min_of(extent.box.hi, edge)};
}
Aabb reach_of(const Aabb& built) {
    constexpr float far = max_coordinate * (1.0f + 0x1p-20f);
    const auto low = [](float x) { return x <= -max_coordinate ? -far : x; };
    const auto high = [](float x) { return x >= max_coordinate ? far : x; };
    return {{low(built.lo.x), low(built.lo.y), low(built.lo.z)},
            {high(built.hi.x), high(built.hi.y), high(built.hi.z)}};
}

Bvh binary_tree(std::span<const std::uint32_t> parts, std::span<const Extent> extents,
                Quality quality) {
    std::vector<Aabb> boxes(parts.size());
    for (std::size_t k = 0; k < parts.size(); ++k) boxes[k] = built_box(extents[parts[k]]);
    // Boxes cannot be split.
    BuildOptions options =
        build_options_for(quality == Quality::fast ? Quality::fast : Quality::balanced);
    options.max_leaf = 1;
    return build_bvh(std::span<const Aabb>(boxes), options);
}

std::uint32_t word_of(const BvhNode& child) {
    if (WideTree::is_inner(child)) return child.first;
    return wide_leaf_bit | child.first << 3 | (child.count - 1);
}

void set_node(std::span<const BvhNode> slots, const Vec3& middle, WideNode& node) {
    // The smallest box in slot 0, as in trees of triangles.
    std::array<BvhNode, quantised_width> children;
    std::array<double, quantised_width> areas;
    std::size_t count = 0;
    for (const BvhNode& child : slots) {
        if (WideTree::is_unused(child)) continue;
        const double area = half_area({child.lo, child.hi});
        std::size_t at = count++;
        for (; at > 0 && areas[at - 1] > area; --at)
            areas[at] = areas[at - 1], children[at] = children[at - 1];
        areas[at] = area, children[at] = child;
    }
    SlotBoxes boxes;
    std::fill_n(node.child, quantised_width, wide_no_child);
    for (std::size_t s = 0; s < count; ++s) {
        boxes.set(static_cast<int>(s), reach_of({children[s].lo, children[s].hi}));
        node.child[s] = word_of(children[s]);
    }
    set_boxes_about(middle, boxes, node);
}

}  // namespace

void build_part_tree(std::span<const std::uint32_t> parts, std::span<const Extent> extents,
                     Quality quality, PartTree& out) {
    out.part.clear();
    if (parts.empty()) return;
    const Bvh bvh = binary_tree(parts, extents, quality);
    const WideTree wide = collapse_to_wide(bvh, {.width = quantised_width, .max_leaf = 1});
    out.arrays.set_bounds(reach_of(bvh.bounds()));
    out.arrays.nodes.reset(wide.node_count());
    for_each_index(
        wide.node_count(),
        [&](std::size_t w) {
            set_node(wide.node(static_cast<std::uint32_t>(w)), out.arrays.middle,
                     out.arrays.nodes[w]);
        },
        256);
    out.arrays.stats.max_depth = wide.max_depth;
    out.part.resize(parts.size());
    for (std::size_t k = 0; k < parts.size(); ++k) out.part[k] = parts[bvh.order()[k]];
    TriangleBlock none;
    out.view = view_of(out.arrays, none);
    out.view.room = nullptr;
    double error = 0;
    for (const std::uint32_t part : parts) error = std::max(error, extents[part].error);
    out.growth.rate = std::nextafterf(static_cast<float>(error + float_rounding), infinity);
    out.growth.least = static_cast<float>(float_rounding * largest_coordinate(out.arrays.bounds));
}

}  // namespace raydix
