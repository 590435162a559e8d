// Where the nodes of a model stand in the world.
#pragma once

#include <raydix/model.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/double3.h"
#include "base/math.h"
#include "base/mirrors.h"

namespace raydix {

/// An affine map of a node, or of several that follow each other.
struct NodeMap {
    Double3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};  // rows
    Double3 move;

    NodeMap() = default;
    /// Rounded to float, as instances have it. What floats cannot hold stays a double.
    explicit NodeMap(const TransformD& t)
        : x(entry(t.m[0][0]), entry(t.m[0][1]), entry(t.m[0][2])),
          y(entry(t.m[1][0]), entry(t.m[1][1]), entry(t.m[1][2])),
          z(entry(t.m[2][0]), entry(t.m[2][1]), entry(t.m[2][2])),
          move(entry(t.m[0][3]), entry(t.m[1][3]), entry(t.m[2][3])) {}

    [[nodiscard]] bool is_identity() const {
        return same(x, {1, 0, 0}) && same(y, {0, 1, 0}) && same(z, {0, 0, 1}) &&
               same(move, {0, 0, 0});
    }
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
    static double entry(double value) {
        const auto rounded = static_cast<float>(value);
        return std::isnormal(rounded) ? rounded : value;
    }
    static bool same(Double3 a, Double3 b) { return a.x == b.x && a.y == b.y && a.z == b.z; }
};

/// The ways of all nodes to the world. A vertex goes through its node's map, then through those of
/// the nodes above, each in turn in double, and is rounded once: as queries move the vertices of
/// instances (engine/flat_scene.h), so that both have the same bits.
class NodeWays {
public:
    /// Stands for a mesh without a node.
    static constexpr std::uint32_t world = ModelNode::none;
    /// Where more maps follow each other, which scenes do not hold, the outer ones are multiplied.
    static constexpr std::uint32_t most_steps = 32;

    explicit NodeWays(const Model& model) {
        first_.reserve(model.nodes.size());
        for (const ModelNode& node : model.nodes) {
            const std::uint32_t outer = node.parent == ModelNode::none ? none : first_[node.parent];
            const NodeMap own(node.transform);
            first_.push_back(own.is_identity() ? outer : add(own, outer));
        }
    }

    [[nodiscard]] bool stays(std::uint32_t node) const { return begin_of(node) == none; }
    /// Whether an odd number of the maps mirror.
    [[nodiscard]] bool mirrors(std::uint32_t node) const {
        const std::uint32_t first = begin_of(node);
        return first != none && steps_[first].mirrors;
    }
    /// What does not move stays as it is: Inf must not become 0 * Inf.
    [[nodiscard]] Vec3 moved(std::uint32_t node, Vec3 vertex) const {
        std::uint32_t at = begin_of(node);
        if (at == none) return vertex;
        Double3 p(vertex);
        for (; at != none; at = steps_[at].outer) p = steps_[at].map.point(p);
        return without_negative_zero(p.rounded());
    }

private:
    static constexpr std::uint32_t none = 0xFFFFFFFFu;
    struct Step {
        NodeMap map;
        std::uint32_t outer;  // the step that goes on from there; none: this is the world
        std::uint32_t count;  // of steps from here on
        bool mirrors;         // with those that follow
    };

    [[nodiscard]] std::uint32_t begin_of(std::uint32_t node) const {
        return node == world ? none : first_[node];
    }
    std::uint32_t add(const NodeMap& own, std::uint32_t outer) {
        Step step{own, outer, 1, raydix::mirrors(own.x, own.y, own.z)};
        if (outer != none) {
            const Step& next = steps_[outer];
            step.mirrors = step.mirrors != next.mirrors;
            step.count = next.count + 1;
            if (step.count > most_steps) {
                step.map = next.map.times(own);
                step.outer = next.outer;
                step.count = next.count;
            }
        }
        steps_.push_back(step);
        return static_cast<std::uint32_t>(steps_.size() - 1);
    }

    std::vector<std::uint32_t> first_;  // [nodes] the step that a node begins with
    std::vector<Step> steps_;
};

}  // namespace raydix
