// Where the nodes of a model stand in the world.
#pragma once

#include <raydix/model.h>

#include "base/double3.h"
#include "base/math.h"

namespace raydix {

/// A node's map to the world.
struct NodeMap {
    Double3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};  // rows
    Double3 move;

    NodeMap() = default;
    explicit NodeMap(const TransformD& t)
        : x(t.m[0][0], t.m[0][1], t.m[0][2]),
          y(t.m[1][0], t.m[1][1], t.m[1][2]),
          z(t.m[2][0], t.m[2][1], t.m[2][2]),
          move(t.m[0][3], t.m[1][3], t.m[2][3]) {}

    [[nodiscard]] bool is_identity() const {
        return same(x, {1, 0, 0}) && same(y, {0, 1, 0}) && same(z, {0, 0, 1}) &&
               same(move, {0, 0, 0});
    }
    [[nodiscard]] bool mirrors() const { return dot(cross(x, y), z) < 0; }
    [[nodiscard]] Double3 point(Double3 p) const {
        return Double3{dot(x, p), dot(y, p), dot(z, p)} + move;
    }
    /// This map after `inner`.
    [[nodiscard]] NodeMap times(const NodeMap& inner) const {
        const auto row = [&](Double3 r) { return inner.x * r.x + inner.y * r.y + inner.z * r.z; };
        NodeMap product;
        product.x = row(x), product.y = row(y), product.z = row(z);
        product.move = point(inner.move);
        return product;
    }

private:
    static bool same(Double3 a, Double3 b) { return a.x == b.x && a.y == b.y && a.z == b.z; }
};

/// [nodes].
[[nodiscard]] inline std::vector<NodeMap> node_maps(const Model& model) {
    std::vector<NodeMap> maps;
    maps.reserve(model.nodes.size());
    for (const ModelNode& node : model.nodes) {
        const NodeMap own(node.transform);
        maps.push_back(node.parent == ModelNode::none ? own : maps[node.parent].times(own));
    }
    return maps;
}

/// Rounded once. What does not move stays as it is: Inf must not become 0 * Inf.
[[nodiscard]] inline Vec3 moved(const NodeMap& map, bool is_identity, Vec3 p) {
    return is_identity ? p : without_negative_zero(map.point(Double3(p)).rounded());
}

}  // namespace raydix
