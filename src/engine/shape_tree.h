// A geometry of a scene that is not made of triangles: what was added, and the tree over it.
#pragma once

#include <raydix/double.h>
#include <raydix/scene.h>
#include <raydix/shapes.h>
#include <raydix/user_geometry.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "engine/extent.h"
#include "engine/part_tree.h"

namespace raydix {

/// Points with one radius.
template <class Scalar>
struct BasicBalls {
    std::span<const BasicVec3<Scalar>> centers;
    Scalar radius;
};

/// What was added; whose the arrays are its owner knows.
template <class Scalar>
using BasicShapes =
    std::variant<std::span<const BasicSphere<Scalar>>, std::span<const BasicCapsule<Scalar>>,
                 BasicBalls<Scalar>, BasicUserGeometry<Scalar>>;
using Shapes = BasicShapes<float>;

/// In the order of BasicShapes.
template <class AnyShapes>
[[nodiscard]] GeometryKind geometry_kind_of(const AnyShapes& shapes) {
    return static_cast<GeometryKind>(static_cast<std::size_t>(GeometryKind::spheres) +
                                     shapes.index());
}
/// As messages say it.
[[nodiscard]] constexpr const char* name_of_kind(GeometryKind kind) {
    constexpr const char* names[] = {"a mesh", "spheres",       "capsules",
                                     "points", "user geometry", "an instance"};
    return names[static_cast<std::size_t>(kind)];
}
template <class AnyShapes>
[[nodiscard]] const char* kind_of(const AnyShapes& shapes) {
    return name_of_kind(geometry_kind_of(shapes));
}
template <class AnyShapes>
[[nodiscard]] std::size_t count_of(const AnyShapes& shapes) {
    return std::visit(
        [](const auto& all) -> std::size_t {
            if constexpr (requires { all.centers; })
                return all.centers.size();
            else if constexpr (requires { all.boxes(); })
                return all.boxes().size();
            else
                return all.size();
        },
        shapes);
}
/// Rounded outward; of what is no shape, a box that builders leave out. Throws InputError: 2^28
/// primitives or more.
template <class Scalar>
[[nodiscard]] std::vector<BasicAabb<Scalar>> boxes_of(const BasicShapes<Scalar>& shapes);
extern template std::vector<Aabb> boxes_of<float>(const BasicShapes<float>&);
extern template std::vector<AabbD> boxes_of<double>(const BasicShapes<double>&);

/// A geometry, beside the tree over its primitives.
template <class Scalar>
struct ShapeGeometry {
    std::uint32_t id = 0, mask = 0;
    std::shared_ptr<const void> own;  // what `shapes` views
    BasicShapes<Scalar> shapes = {};

    [[nodiscard]] const BasicUserGeometry<Scalar>* user() const {
        return std::get_if<BasicUserGeometry<Scalar>>(&shapes);
    }
};

/// " on path 2 of instances", as errors say where something is; nothing for path 0.
[[nodiscard]] inline std::string on_path(std::uint32_t path) {
    return path == 0 ? "" : " on path " + std::to_string(path) + " of instances";
}
/// "geometry 3 (spheres) on path 2 of instances".
template <class Scalar>
[[nodiscard]] std::string name_of(const ShapeGeometry<Scalar>& geometry, std::uint32_t path) {
    return "geometry " + std::to_string(geometry.id) + " (" + kind_of(geometry.shapes) + ")" +
           on_path(path);
}

/// A tree over the primitives of one geometry. `part` has their numbers.
struct ShapeTree : PartTree, ShapeGeometry<float> {
    // As leaves name them, if that is what they are: one behind the other.
    Buffer<Sphere> spheres;  // points too; and room for a whole vector behind the last
    Buffer<Capsule> capsules;
    // Where the primitives are that leaves name, and how large they are. Of user geometry only the
    // caller knows: all of its leaves are said to be at the root.
    std::uintptr_t leaves = 0;
    std::size_t leaf_bytes = 0;
    bool is_at_hand = false;  // it lies in a cache of one core: rays have nothing to wait for
    Aabb bounds = empty_box();
    Extent extent;  // lines in double may miss the bounds by so much

    /// Gives a hit of the tree its geometry.
    void name(Hit& hit) const { hit.geometry = id; }
    [[nodiscard]] std::uint64_t bytes() const {
        return arrays.nodes.size() * sizeof(WideNode) + part.size() * sizeof(part[0]) +
               spheres.size() * sizeof(Sphere) + capsules.size() * sizeof(Capsule);
    }
};

/// The same in double. `around` has the room that rays need.
struct ShapeTreeD : PartTreeD, ShapeGeometry<double> {
    AabbD bounds = nothing_d;

    /// Calls use(a, b, radius) with a ball's center, or the ends of a capsule: of primitive `prim`,
    /// which is no user geometry.
    template <class Use>
    auto with_capsule(std::uint32_t prim, const Use& use) const {
        if (const auto* const spheres = std::get_if<std::span<const SphereD>>(&shapes))
            return use((*spheres)[prim].center, (*spheres)[prim].center, (*spheres)[prim].radius);
        if (const auto* const balls = std::get_if<BasicBalls<double>>(&shapes))
            return use(balls->centers[prim], balls->centers[prim], balls->radius);
        const CapsuleD& capsule = std::get<std::span<const CapsuleD>>(shapes)[prim];
        return use(capsule.a, capsule.b, capsule.radius);
    }
    [[nodiscard]] std::uint64_t bytes() const {
        return arrays.nodes.size() * sizeof(WideNode) + part.size() * sizeof(part[0]);
    }
};

/// Vectors of spheres are read whole.
inline constexpr std::size_t sphere_lanes = 8;

/// `old`: the tree of the last commit, whose nodes may stay around the same primitives while their
/// cost is at most `limit` times that at its build; or null. `refitted`: whether they stayed.
[[nodiscard]] std::shared_ptr<const ShapeTree> make_shape_tree(
    std::uint32_t id, std::uint32_t mask, const Shapes& shapes, std::shared_ptr<const void> own,
    Quality quality, const ShapeTree* old, double limit, bool& refitted);
/// In double. Never refitted.
[[nodiscard]] std::shared_ptr<const ShapeTreeD> make_shape_tree(
    std::uint32_t id, std::uint32_t mask, const BasicShapes<double>& shapes,
    std::shared_ptr<const void> own, Quality quality, const ShapeTreeD* old, double limit,
    bool& refitted);

}  // namespace raydix
