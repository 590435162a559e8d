// The first contact of a moving ball with the triangles of a tree, in float and in double.
#pragma once

#include <raydix/double.h>
#include <raydix/overlap.h>

#include "proximity/closest_walk.h"
#include "proximity/round_shapes.h"
#include "trace/grown_boxes.h"
#include "trace/ray_frame.h"

namespace raydix {

inline bool is_valid(const SphereSweep& s) {
    return is_valid(s.path) && s.radius >= 0.0f && s.radius < infinity;
}
inline bool is_valid(const SphereSweepD& s) {
    constexpr double limit = 1e150;  // squares of what is larger overflow
    const auto ok = [](double x) { return std::fabs(x) <= limit; };
    return is_valid(s.path) && ok(s.path.origin.x) && ok(s.path.origin.y) && ok(s.path.origin.z) &&
           s.radius >= 0.0 && s.radius <= limit;
}

/// `ray` must be valid.
inline Path path_of(const Ray& ray) {
    return {Double3(ray.origin), Double3(ray.direction), std::max(0.0, double(ray.tmin)),
            double(ray.tmax)};
}

/// One pure function of path, radius and triangle: t, not before the path enters the triangle's own
/// box, or infinity. What is later than `latest` may be infinity too.
inline float first_contact(const Path& path, const GrownBoxes& boxes, double radius,
                           const LeafTriangle& t, float latest = infinity) {
    const Aabb box = box_of(t.v0, t.v1, t.v2);
    const double own = boxes.enter(box.lo, box.hi);
    if (own == never || static_cast<float>(own) > latest) return infinity;
    return static_cast<float>(enter_rounded_triangle(path, {}, t, radius, own));
}

/// 2^-24 of all lengths that meet in a contact: above how far a ball at it may be from touching,
/// which is most (2^-26) where the ball moves nearly along an edge.
inline constexpr double part_room = 0x1p-24;

/// A tree, and how far its coordinates reach if leaves may hold parts of triangles.
struct SweepTree : TriangleTree {
    bool parts;
    double reach = 0.0;

    explicit SweepTree(const Bvh& bvh) : TriangleTree(bvh), parts(bvh.has_split_primitives()) {
        if (!parts) return;
        const Vec3 far = max_of(bvh.bounds().hi, -1.0f * bvh.bounds().lo);
        reach = max_of(max_of(far.x, far.y), max_of(far.z, 0.0f));
    }
};

/// The floats as they are. The vectorizer of GCC 12 drops a rounding to float that is promoted
/// again behind it (-O3, straight-line code), so that bits would depend on the level of
/// optimization.
inline Vec3 kept(Vec3 p) {
#if defined(__GNUC__) && !defined(__clang__)
    asm("" : "+m"(p));
#endif
    return p;
}

/// A valid sweep among the nodes and triangles of a tree.
class SweepFrame {
public:
    SweepFrame(const SweepTree& tree, const SphereSweep& sweep)
        : path_(path_of(sweep.path)),
          radius_(sweep.radius),
          boxes_(path_, radius_),
          nodes_(path_, radius_ + room(tree)) {}

    [[nodiscard]] float contact(const LeafTriangle& t, float latest = infinity) const {
        return first_contact(path_, boxes_, radius_, t, latest);
    }
    /// Not later than the contact with any triangle in it. Both are rounded to float in the same
    /// way, so that a node is not skipped for a contact of equal t that is found before.
    [[nodiscard]] float enter(const BvhNode& node) const {
        const double t = nodes_.enter(node.lo, node.hi);
        return t == never ? infinity : static_cast<float>(t * (1.0 - 1e-12));
    }
    [[nodiscard]] Vec3 center(float t) const { return kept(path_.at(t).rounded()); }
    [[nodiscard]] float in_units_of_caller(float t) const { return t + 0.0f; }  // -0 becomes +0

private:
    /// A node around a whole triangle is entered no later than the triangle's own box, since each
    /// step is monotone, and contacts are held behind that. Parts have no own box.
    [[nodiscard]] double room(const SweepTree& tree) const {
        if (!tree.parts) return 0.0;
        const Double3 from = path_.origin;
        const double far =
            std::max(std::fabs(from.x), std::max(std::fabs(from.y), std::fabs(from.z)));
        return part_room * (far + tree.reach + radius_);
    }

    Path path_;
    double radius_;
    GrownBoxes boxes_;  // of triangles
    GrownBoxes nodes_;
};

/// The same in double. Long and short directions are scaled as those of rays, or their squares
/// would overflow; t is in units of the scaled one.
class SweepFrameD {
public:
    SweepFrameD(const PaddedTreeD& tree, const SphereSweepD& sweep)
        : SweepFrameD(make_frame(sweep.path), tree, sweep) {}

    /// As first_contact: a pure function of sweep and triangle.
    [[nodiscard]] double contact(const LeafTriangleD& t, double latest = never) const {
        const AabbD box = box_of(t.v0, t.v1, t.v2);
        const double own = boxes_.enter(box.lo - start_, box.hi - start_);
        if (own == never || own > latest) return never;
        return enter_rounded_triangle(path_, Double3(start_), t, radius_, own);
    }
    /// Not later than any triangle's own box in it, see `room`.
    [[nodiscard]] double enter(const BvhNode& node) const {
        return nodes_.enter(node.lo, node.hi) * (1.0 - 1e-12);
    }
    [[nodiscard]] Vec3d center(double t) const {
        Vec3d at;
        (Double3(start_) + path_.direction * t).round_to(at);
        return at;
    }
    [[nodiscard]] double in_units_of_caller(double t) const {
        return t * t_scale_ + 0.0;  // -0 becomes +0
    }

private:
    SweepFrameD(const RayFrameD& ray, const PaddedTreeD& tree, const SphereSweepD& sweep)
        : start_(ray.origin),
          path_{{},
                Double3(sweep.path.direction * ray.t_scale),
                ray.tmin,
                sweep.path.tmax / ray.t_scale},
          radius_(sweep.radius),
          t_scale_(ray.t_scale),
          boxes_(path_, radius_),
          nodes_(path_among_nodes(tree.space), room(tree)) {}

    [[nodiscard]] Path path_among_nodes(const TreeSpace& space) const {
        return {Double3(space.local(start_)), path_.direction * space.scale, path_.tmin,
                path_.tmax};
    }
    /// Start and sums are rounded where the nodes are: eight times the bound of one rounding holds
    /// what these and the own box's differ by. Parts have no own box: their room is how far the
    /// ball may be from touching at the contact, worst where it moves nearly along an edge (2^-26).
    [[nodiscard]] double room(const PaddedTreeD& tree) const {
        const Vec3d at = tree.space.local(start_);
        const double far = max_of(max_of(std::fabs(at.x), std::fabs(at.y)), std::fabs(at.z));
        const double radius = radius_ * tree.space.scale;
        return radius + (tree.parts ? part_room : 0x1p-50) * (far + tree.reach + radius);
    }

    Vec3d start_;
    Path path_;  // starts at 0
    double radius_, t_scale_;
    GrownBoxes boxes_;  // around corners that are relative to the start
    GrownBoxes nodes_;
};

template <class Scalar>
struct BasicContact {
    Scalar t = infinity;
    std::uint32_t prim = no_primitive, position = no_primitive;
};
using Contact = BasicContact<float>;

/// The least (t, prim), in the frame's units. The tree must not be empty.
template <class Tree, class Frame, class Scalar = typename Tree::Scalar>
BasicContact<Scalar> find_first_contact(const Tree& tree, const Frame& sweep,
                                        BasicWalkStack<Scalar>& stack) {
    BasicContact<Scalar> best;
    const auto leaf = [&](const BvhNode& node) {
        for (std::uint32_t k = node.first; k < node.first + node.count; ++k) {
            const Scalar t = sweep.contact(tree.triangles[k], best.t);
            if (t < best.t || (t == best.t && t < infinity && tree.order[k] < best.prim))
                best = {t, tree.order[k], k};
        }
        return false;
    };
    walk_entered(
        tree.nodes, stack, [&](const BvhNode& node) { return sweep.enter(node); }, leaf,
        [&] { return best.t; });
    return best;
}

}  // namespace raydix
