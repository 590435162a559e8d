// What segments and moving balls ask of boxes and triangles, as near_probes.h has it for distances:
// boxes in double, in the query's space. Included once per instruction set.
#if defined(RAYDIX_ENGINE_NEAR_CONTACTS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_NEAR_CONTACTS_H
#undef RAYDIX_ENGINE_NEAR_CONTACTS_H
#else
#define RAYDIX_ENGINE_NEAR_CONTACTS_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/near_job.h"
#include "engine/near_probes.h"
#include "engine/near_shapes.h"
#include "engine/near_triangles.h"
#include "primitives/exact_overlap.h"
#include "proximity/sweep_walk.h"
#include "trace/simd/lanes.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Boxes in the query's space, in double: their middles and how far they reach.
struct DoubleBoxes {
    Doubles3 middle, reach;
};

/// What makes those of a node's children.
struct BoxFrame {
    Double3 middle;
    const NearWay* way;  // null: they are where the query is
    double pad;

    BoxFrame(const NearTree& tree, const NearSpace* space, double part_of_lengths, double lengths)
        : middle(tree.middle()), way(space == nullptr ? nullptr : space->way) {
        const double most = way == nullptr ? tree.largest_coordinate() : way->size;
        pad = part_of_lengths * (most + lengths) + 0x1p-22 * (way == nullptr ? 0.0 : way->size) +
              tree.room * most + (tree.view.is_compact ? compact_room * most : 0.0);
    }

    template <class Node>
    HWY_INLINE DoubleBoxes boxes(const Node& node, std::size_t l) const {
        const auto axis = [&](int k, double from, VD& m, VD& r) {
            VD lo, hi;
            planes(node, k, l, lo, hi);
            const VD half = hn::Set(doubles, 0.5);
            m = hn::Add(hn::Mul(hn::Add(lo, hi), half), hn::Set(doubles, from));
            r = hn::Mul(hn::Sub(hi, lo), half);
        };
        DoubleBoxes out;
        axis(0, middle.x, out.middle.x, out.reach.x);
        axis(1, middle.y, out.middle.y, out.reach.y);
        axis(2, middle.z, out.middle.z, out.reach.z);
        if (way != nullptr) {
            const Affine& map = way->map;
            const auto row = [&](const Double3& by, double move, VD& m, VD& r) {
                const Doubles3 v{hn::Set(doubles, by.x), hn::Set(doubles, by.y),
                                 hn::Set(doubles, by.z)};
                m = hn::Add(dot(v, out.middle), hn::Set(doubles, move));
                r = dot({hn::Abs(v.x), hn::Abs(v.y), hn::Abs(v.z)}, out.reach);
            };
            DoubleBoxes moved;
            row(map.x, map.move.x, moved.middle.x, moved.reach.x);
            row(map.y, map.move.y, moved.middle.y, moved.reach.y);
            row(map.z, map.move.z, moved.middle.z, moved.reach.z);
            out = moved;
        }
        const VD by = hn::Set(doubles, pad);
        out.reach = {hn::Add(out.reach.x, by), hn::Add(out.reach.y, by), hn::Add(out.reach.z, by)};
        return out;
    }

private:
    static HWY_INLINE void planes(const WideNode& node, int axis, std::size_t l, VD& lo, VD& hi) {
        lo = hn::PromoteTo(doubles, hn::Load(floats, node.lo[axis] + l));
        hi = hn::PromoteTo(doubles, hn::Load(floats, node.hi[axis] + l));
    }
    static HWY_INLINE void planes(const CompactNode& node, int axis, std::size_t l, VD& lo,
                                  VD& hi) {
        alignas(32) float low[8], high[8];
        for (std::size_t k = 0; k < 8; k += lanes8) {
            const Planes both = planes_of(node, axis, k);
            hn::Store(both.lo, f8, low + k);
            hn::Store(both.hi, f8, high + k);
        }
        lo = hn::PromoteTo(doubles, hn::Load(floats, low + l));
        hi = hn::PromoteTo(doubles, hn::Load(floats, high + l));
    }
};

/// Bit s: there is a child in slot s.
HWY_INLINE std::uint32_t children_of(const WideNode& node) {
    std::uint32_t used = 0;
    for (std::uint32_t s = 0; s < 8; ++s)
        used |= std::uint32_t{node.child[s] != wide_no_child} << s;
    return used;
}
HWY_INLINE std::uint32_t children_of(const CompactNode& node) { return node.used; }

/// What a segment touches.
class SegmentProbe {
public:
    SegmentProbe(const Segment& segment, TouchSink& sink) : segment_(segment), sink_(sink) {
        const Double3 a(segment.a), b(segment.b);
        middle_ = (a + b) * 0.5;
        half_ = (b - a) * 0.5;
        const auto most = [](Double3 p) {
            return std::max({std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)});
        };
        lengths_ = std::max(most(a), most(b));
    }

    using Frame = BoxFrame;
    [[nodiscard]] Frame frame(const NearTree& tree, const NearSpace* space) const {
        return {tree, space, 0x1p-40, lengths_};
    }
    [[nodiscard]] float limit(const Frame&) const { return 0; }
    /// Boxes with no plane between them and the segment, of those that lie along an axis or along
    /// the segment and an axis.
    template <class Node>
    HWY_INLINE std::uint32_t near(const Frame& frame, const Node& node, float, float* keys) const {
        std::uint32_t bits = 0;
        const Doubles3 half{hn::Set(doubles, half_.x), hn::Set(doubles, half_.y),
                            hn::Set(doubles, half_.z)},
            size{hn::Abs(half.x), hn::Abs(half.y), hn::Abs(half.z)},
            from{hn::Set(doubles, middle_.x), hn::Set(doubles, middle_.y),
                 hn::Set(doubles, middle_.z)};
        for (std::size_t l = 0; l < 8; l += double_lanes) {
            const DoubleBoxes boxes = frame.boxes(node, l);
            const Doubles3 off = boxes.middle - from, turned = cross(half, off);
            const Doubles3& r = boxes.reach;
            const auto along = [](VD d, VD reach, VD of_segment) {
                return hn::Le(hn::Abs(d), hn::Add(reach, of_segment));
            };
            const auto across = [](VD d, VD r1, VD s2, VD r2, VD s1) {
                return hn::Le(hn::Abs(d), hn::Add(hn::Mul(r1, s2), hn::Mul(r2, s1)));
            };
            const MD axes = hn::And(hn::And(along(off.x, r.x, size.x), along(off.y, r.y, size.y)),
                                    along(off.z, r.z, size.z));
            const MD planes = hn::And(hn::And(across(turned.x, r.y, size.z, r.z, size.y),
                                              across(turned.y, r.z, size.x, r.x, size.z)),
                                      across(turned.z, r.x, size.y, r.y, size.x));
            bits |= bits_of(doubles, hn::And(axes, planes)) << l;
        }
        std::fill_n(keys, 8, 0.0f);
        return bits & children_of(node);
    }
    bool triangles(const TriangleBlock& block, std::uint32_t lanes, const MeshTree& mesh,
                   std::uint32_t number) {
        for (; lanes != 0; lanes &= lanes - 1) {
            const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
            if (segment_touches_triangle(segment_.a, segment_.b, triangle_of(block, lane)) &&
                sink_.take_triangle(block.prim[lane], mesh, number))
                return true;
        }
        return false;
    }
    bool shapes(const ShapeTree& tree, std::uint32_t place, std::uint32_t count,
                const NearSpace* space, std::uint32_t number) {
        Double3 from(segment_.a), to(segment_.b);
        if (space != nullptr) {
            from = space->way->inverse.point(from);
            to = space->way->inverse.point(to);
        }
        for (std::uint32_t k = place; k < place + count; ++k) {
            const Capsule capsule =
                tree.spheres.empty() ? tree.capsules[k] : capsule_of(tree.spheres[k]);
            if (segment_touches_capsule(from, to, capsule) &&
                sink_.take_name({number, tree.id, tree.part[k]}))
                return true;
        }
        return false;
    }

private:
    Segment segment_;
    TouchSink& sink_;
    Double3 middle_, half_;
    double lengths_;
};

/// Where a moving ball first touches. Without a radius it is a ray.
class SweepProbe {
public:
    explicit SweepProbe(const SphereSweep& sweep)
        : ray_(make_frame(sweep.path)),
          is_ray_(sweep.radius == 0.0f),
          radius_(sweep.radius),
          path_(is_ray_ ? Path{Double3(ray_.origin), Double3(ray_.direction), ray_.tmin, ray_.tmax}
                        : path_of(sweep.path)),
          boxes_(path_, radius_),
          best_{is_ray_ ? ray_.tmax : infinity} {
        const Double3 o = path_.origin;
        lengths_ = std::max({std::fabs(o.x), std::fabs(o.y), std::fabs(o.z)}) + radius_;
    }

    using Frame = BoxFrame;
    [[nodiscard]] Frame frame(const NearTree& tree, const NearSpace* space) const {
        return {tree, space, 0x1p-19, lengths_};
    }
    [[nodiscard]] float limit(const Frame&) const { return best_.t; }
    [[nodiscard]] const NearContact& best() const { return best_; }

    /// As GrownBoxes: no contact with what is in a box is before its key.
    template <class Node>
    HWY_INLINE std::uint32_t near(const Frame& frame, const Node& node, float limit,
                                  float* keys) const {
        std::uint32_t bits = 0;
        const VD radius = hn::Set(doubles, radius_);
        for (std::size_t l = 0; l < 8; l += double_lanes) {
            const DoubleBoxes boxes = frame.boxes(node, l);
            VD enter = hn::Set(doubles, path_.tmin), leave = hn::Set(doubles, path_.tmax);
            const auto axis = [&](VD middle, VD reach, double origin, double direction) {
                const VD off = hn::Sub(middle, hn::Set(doubles, origin)),
                         by = hn::Add(reach, radius);
                const VD below = hn::Sub(off, by), above = hn::Add(off, by);
                const VD zero = hn::Zero(doubles);
                if (direction == 0.0) {
                    const MD beside = hn::Or(hn::Gt(below, zero), hn::Lt(above, zero));
                    leave = hn::IfThenElse(beside, hn::Set(doubles, -never), leave);
                    return;
                }
                const VD rate = hn::Set(doubles, 1.0 / direction);
                enter = hn::Max(enter, hn::Mul(direction > 0.0 ? below : above, rate));
                leave = hn::Min(leave, hn::Mul(direction > 0.0 ? above : below, rate));
            };
            axis(boxes.middle.x, boxes.reach.x, path_.origin.x, path_.direction.x);
            axis(boxes.middle.y, boxes.reach.y, path_.origin.y, path_.direction.y);
            axis(boxes.middle.z, boxes.reach.z, path_.origin.z, path_.direction.z);
            const VD slack =
                hn::Mul(hn::Set(doubles, 1e-12), hn::Add(hn::Abs(enter), hn::Abs(leave)));
            const VF key =
                hn::DemoteTo(floats, hn::Min(hn::Mul(enter, hn::Set(doubles, 1.0 - 1e-12)),
                                             hn::Set(doubles, double{most_float})));
            hn::Store(key, floats, keys + l);
            bits |= (bits_of(doubles, hn::Le(enter, hn::Add(leave, slack))) &
                     bits_of(floats, hn::Le(key, hn::Set(floats, limit))))
                    << l;
        }
        return bits & children_of(node);
    }
    bool triangles(const TriangleBlock& block, std::uint32_t lanes, const MeshTree& mesh,
                   std::uint32_t number) {
        for (; lanes != 0; lanes &= lanes - 1) {
            const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
            const LeafTriangle triangle = triangle_of(block, lane);
            TriangleHit hit{};
            if (!meet(triangle, hit)) continue;
            const TriangleName name(mesh, block.prim[lane]);
            const NearContact contact{hit.t,    number, name.geometry, name.prim,
                                      triangle, hit.u,  hit.v};
            if (hit.t < best_.t || contact.order() < best_.order()) best_ = contact;
        }
        return false;
    }
    /// There are none that the mask shows.
    static bool shapes(const ShapeTree&, std::uint32_t, std::uint32_t, const NearSpace*,
                       std::uint32_t) {
        return false;
    }

private:
    bool meet(const LeafTriangle& triangle, TriangleHit& hit) const {
        if (is_ray_) return intersect_triangle<EdgeRule::closed>(ray_, triangle, best_.t, hit);
        hit.t = first_contact(path_, boxes_, radius_, triangle, best_.t);
        return hit.t <= best_.t && hit.t < infinity;
    }

    RayFrame ray_;
    bool is_ray_;
    double radius_;
    Path path_;
    GrownBoxes boxes_;
    NearContact best_;
    double lengths_;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
