// Trees -> the boxes or cells of their nodes, with levels, in preorder.
#include <raydix/tree_view.h>

namespace raydix {
namespace {

/// A node whose box is known, and its level.
struct Waiting {
    std::uint32_t slot, level;
    Aabb box;
    bool own;  // whether the box is this node's alone
};

float& component_of(Vec3& v, std::uint32_t axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

}  // namespace

std::vector<LevelBox> level_boxes(const Bvh& bvh, LevelRange levels) {
    std::vector<LevelBox> boxes;
    std::vector<Waiting> waiting;
    const auto enter = [&](std::uint32_t slot, std::uint32_t level) {
        const BvhNode& node = bvh.nodes()[slot];
        waiting.push_back({slot, level, {node.lo, node.hi}, true});
    };
    if (!bvh.empty()) enter(0, 0);
    while (!waiting.empty()) {
        const Waiting at = waiting.back();
        waiting.pop_back();
        if (levels.contains(at.level)) boxes.push_back({at.box, at.level});
        const BvhNode& node = bvh.nodes()[at.slot];
        if (node.is_leaf() || at.level >= levels.last) continue;
        enter(node.first + 1, at.level + 1);
        enter(node.first, at.level + 1);
    }
    return boxes;
}

std::vector<LevelBox> level_boxes(const KdTree& tree, LevelRange levels) {
    std::vector<LevelBox> boxes;
    std::vector<Waiting> waiting;
    if (!tree.empty()) waiting.push_back({0, 0, tree.bounds(), true});
    while (!waiting.empty()) {
        const Waiting at = waiting.back();
        waiting.pop_back();
        if (at.own && levels.contains(at.level)) boxes.push_back({at.box, at.level});
        const KdNode& node = tree.nodes()[at.slot];
        if (node.is_leaf() || at.level >= levels.last) continue;
        Waiting left{node.child(), at.level + 1, at.box, !node.splits_equal_codes()};
        Waiting right{node.child() + 1, at.level + 1, at.box, left.own};
        if (left.own) {
            component_of(left.box.hi, node.axis()) = node.plane;
            component_of(right.box.lo, node.axis()) = node.plane;
        }
        waiting.push_back(right);
        waiting.push_back(left);
    }
    return boxes;
}

std::vector<LevelBox> level_boxes(const Octree& octree, LevelRange levels) {
    std::vector<LevelBox> boxes;
    for (std::uint32_t level = 0; level < octree.level_count(); ++level) {
        if (!levels.contains(level)) continue;
        const NodeRange nodes = octree.level_nodes(level);
        for (std::uint32_t node = nodes.begin; node < nodes.end; ++node)
            boxes.push_back({node_box(octree, node), level});
    }
    return boxes;
}

}  // namespace raydix
