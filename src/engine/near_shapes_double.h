// Spheres, capsules and points of a scene in double, on all paths, as they are in the world: a tree
// over their boxes, for queries of distance and overlap.
#pragma once

#include <raydix/double.h>
#include <raydix/scene_queries.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include "engine/near_call.h"
#include "engine/near_shapes.h"
#include "engine/scene_tree_double.h"
#include "engine/shape_tree.h"
#include "proximity/touch_walk.h"

namespace raydix {

/// A geometry on a path.
struct ShapesOnPath {
    std::shared_ptr<const ShapeTreeD> shapes;
    std::uint32_t number;            // of the path
    std::uint32_t first;             // of its primitives among all, by their places in the tree
    std::vector<AffineD> maps;       // to the world, the innermost first
    std::vector<InverseD> inverses;  // and back, the outermost first
    Affine all_maps;                 // their product, without the move
    double condition = 1;            // of the product, at most

    [[nodiscard]] Double3 in_world(Vec3d p) const;
    /// In the geometry's own space.
    [[nodiscard]] Double3 inside(Vec3d p) const;
    /// The point of a primitive's image that is closest to the query.
    [[nodiscard]] ShapePointD closest(std::uint32_t prim, Vec3d query) const;
    /// Decided in the geometry's own space.
    [[nodiscard]] bool touches(std::uint32_t prim, const SegmentD& segment) const;
    /// Around all that `closest` may give and `touches` may take.
    [[nodiscard]] AabbD box_of(std::uint32_t prim) const;
};

class NearShapesD {
public:
    NearShapesD() = default;
    explicit NearShapesD(std::vector<ShapesOnPath> paths);

    [[nodiscard]] bool empty() const { return tree_.empty(); }
    [[nodiscard]] std::uint32_t max_depth() const { return tree_.max_depth(); }
    /// Throws InputError, which names a geometry.
    void require_answers(NearCall call) const {
        if (paths_.empty()) return;
        const ShapesOnPath& first = paths_.front();
        raydix::require_answers(*first.shapes, first.number, call);
    }

    struct Found {
        ShapePointD point;
        ScenePrimitive name;
    };
    /// Puts what is less than (best.point.d2, best.name) in its place; whether there is any. Not
    /// empty; the query must be finite.
    bool find_closest(Vec3d query, Found& best, BasicWalkStack<double>& stack) const;
    /// visit(name) -> whether to stop. Not empty; the query must be valid.
    template <class Visit>
    void for_each_touched(const SphereD& s, BasicWalkStack<double>& stack,
                          const Visit& visit) const {
        const double limit = s.radius * s.radius;
        const auto leaf = [&](const BvhNode& node) {
            for (std::uint32_t k = node.first; k < node.first + node.count; ++k) {
                const Place at = place(k);
                if (at.on_path->closest(at.prim, s.center).d2 <= limit && visit(name_of(at)))
                    return true;
            }
            return false;
        };
        walk_outward(nodes(), distances(s.center), stack, leaf,
                     [&] { return limit * space_.scale * space_.scale; });
    }
    template <class Visit>
    void for_each_touched(const SegmentD& s, BasicWalkStack<double>& stack,
                          const Visit& visit) const {
        for_each_met(nodes(), segment_boxes(space_, s), stack, [&](std::uint32_t k) {
            const Place at = place(k);
            return at.on_path->touches(at.prim, s) && visit(name_of(at));
        });
    }

private:
    struct Place {
        const ShapesOnPath* on_path;
        std::uint32_t prim;
    };
    /// Of a position in leaf order.
    [[nodiscard]] Place place(std::uint32_t position) const;
    [[nodiscard]] static ScenePrimitive name_of(const Place& at) {
        return {at.on_path->number, at.on_path->shapes->id, at.prim};
    }
    [[nodiscard]] const BvhNode* nodes() const { return tree_.nodes().data(); }
    [[nodiscard]] BoxDistancesD distances(Vec3d query) const;

    std::vector<ShapesOnPath> paths_;  // by `first`
    Bvh tree_;                         // over their boxes around `space_`
    TreeSpace space_{{0.0, 0.0, 0.0}, 1.0};
    double reach_ = 0;  // of the nodes' coordinates
};

/// Knows what they are, before they are made.
class NearShapesPlan {
public:
    /// Throws InputError, which names a geometry that the mask shows and the call has no answer
    /// for. The scene must outlive the plan.
    NearShapesPlan(const SceneTreeD& scene, std::uint32_t mask, NearCall call);

    /// The peak of make().
    [[nodiscard]] std::uint64_t bytes() const;
    /// Throws InputError: 2^31 primitives or more on all paths.
    [[nodiscard]] NearShapesD make() const;

private:
    struct Count {
        std::uint64_t primitives = 0, geometries = 0;  // on all paths
    };
    /// `path`: the first that leads to the scene.
    const Count& count(const SceneTreeD& scene, std::uint32_t path);
    struct Way;
    void walk(const SceneTreeD& scene, const Way& way, std::vector<ShapesOnPath>& out) const;

    const SceneTreeD& scene_;
    std::uint32_t mask_;
    NearCall call_;
    std::unordered_map<const SceneTreeD*, Count> counts_;
};

}  // namespace raydix
