// What queries of distance and overlap ask of boxes, triangles and shapes: eight boxes and four
// triangles at a time. Included once per instruction set.
//
// A probe is for one query. Frame: the query as the boxes of one tree see it.
//   Frame frame(tree, space)          of a tree in a space; space null: that of the query
//   float limit(frame)                keys above it do not matter any more
//   near(frame, node, limit, keys)    the children that matter, and their keys, by slot
//   triangles(block, lanes, mesh, number, turned), shapes(tree, place, count, space, number)
//                                     at a leaf, triangles as they are in the world: whether the
//                                     search ends
#if defined(RAYDIX_ENGINE_NEAR_PROBES_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_NEAR_PROBES_H
#undef RAYDIX_ENGINE_NEAR_PROBES_H
#else
#define RAYDIX_ENGINE_NEAR_PROBES_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/near_job.h"
#include "engine/near_shapes.h"
#include "engine/near_triangles.h"
#include "primitives/exact_overlap.h"
#include "proximity/sweep_walk.h"
#include "proximity/touch_walk.h"
#include "trace/simd/lanes.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

constexpr float most_float = std::numeric_limits<float>::max();

/// A tree whose boxes a query is held against.
struct NearTree {
    const WideView& view;
    double room;  // what is in it may reach beyond its boxes by this part of their coordinates

    /// What boxes are about.
    [[nodiscard]] Double3 middle() const {
        if (view.is_compact) return {};
        return {view.middle[0], view.middle[1], view.middle[2]};
    }
    [[nodiscard]] double largest_coordinate() const {
        const auto most = [&](int k) {
            return max_of(std::fabs(view.lo[k]), std::fabs(view.hi[k]));
        };
        return max_of(max_of(most(0), most(1)), most(2));
    }
};

/// Boxes of quantised children round once more.
constexpr double compact_room = 0x1p-21;
/// Points in double may be so far off the face of a part of a triangle, and a little more.
constexpr double part_room_of_points = 0x1p-44;

HWY_INLINE float step_of(const CompactNode& node, int axis) {
    const std::uint32_t bits = std::uint32_t{node.exponent[axis]} << 23;
    return std::bit_cast<float>(bits);
}

/// The planes of eight children along an axis, about the middle of their tree.
struct Planes {
    hn::Vec<F8> lo, hi;
};
HWY_INLINE Planes planes_of(const WideNode& node, int axis, std::size_t l) {
    return {hn::Load(f8, node.lo[axis] + l), hn::Load(f8, node.hi[axis] + l)};
}
HWY_INLINE Planes planes_of(const CompactNode& node, int axis, std::size_t l) {
    const auto step = hn::Set(f8, step_of(node, axis)), origin = hn::Set(f8, node.origin[axis]);
    const auto plane = [&](const std::uint8_t* steps) {
        const auto count = hn::PromoteTo(I8(), hn::LoadU(B8(), steps + l));
        return hn::MulAdd(hn::ConvertTo(f8, count), step, origin);
    };
    return {plane(node.lo[axis]), plane(node.hi[axis])};
}
HWY_INLINE std::uint32_t slots_of(const WideNode&) { return 0xFF; }  // none is beside its children
HWY_INLINE std::uint32_t slots_of(const CompactNode& node) { return node.used; }

/// The place of a point in a space whose boxes have weights, and how far it is off at most.
struct PointInside {
    Double3 at;
    double error;  // in the query's space
};
HWY_INLINE PointInside point_inside(const NearWay& way, Double3 query) {
    const Double3 at = way.inverse.point(query);
    const Double3 off = way.map.point(at) - query;
    const auto most = [](Double3 p) {
        return max_of(max_of(std::fabs(p.x), std::fabs(p.y)), std::fabs(p.z));
    };
    const double far = norm_of(way.map) * most(at) + most(way.map.move) + most(query);
    // The corners in the world are rounded.
    return {at, 2 * length(off) + 0x1p-44 * far + 0x1p-22 * way.size};
}

/// Distances of a point. Sink says what happens to what is close enough:
///   float reach()        squares of distances that still matter, closed
///   Tangent tangent()    a plane behind which nothing does
///   bool take(points, lane, prim, mesh, number, turned), take_shape(point, prim, shapes, number)
///                        whether the search ends
template <class Sink>
class DistanceProbe {
public:
    DistanceProbe(Vec3 query, Sink& sink)
        : query_(query), sink_(sink), far_(!(largest(query) <= 0x1p62f)) {}

    struct Frame {
        hn::Vec<F8> least[3], most[3];  // of the query, about the middle
        hn::Vec<F8> weight[3];
        bool placed;
        double error;
    };

    HWY_INLINE Frame frame(const NearTree& tree, const NearSpace* space) const {
        Frame out;
        out.placed = space != nullptr;
        out.error = 0;
        Double3 at(query_);
        if (out.placed) {
            const PointInside inside = point_inside(*space->way, at);
            at = inside.at;
            out.error = inside.error;
        }
        at = at - tree.middle();
        const double pad =
            tree.largest_coordinate() * (tree.room + (tree.view.is_compact ? compact_room : 0.0));
        const auto set = [&](int axis, double x) {
            const double by = pad + std::fabs(x) * 0x1p-23 + 0x1p-140;
            const auto within = [](double y) {
                return static_cast<float>(
                    min_of(max_of(y, -double{most_float}), double{most_float}));
            };
            // Far away squares overflow: then all boxes are asked.
            out.least[axis] = hn::Set(f8, far_ ? -most_float : within(x - by));
            out.most[axis] = hn::Set(f8, far_ ? most_float : within(x + by));
            if (out.placed) out.weight[axis] = hn::Set(f8, space->way->weight[axis]);
        };
        set(0, at.x), set(1, at.y), set(2, at.z);
        return out;
    }
    /// Keys are off by less than these factors.
    HWY_INLINE float limit(const Frame& frame) const {
        const float reach = sink_.reach();
        if (!frame.placed) return min_of(reach * (1.0f + 0x1p-19f) + 0x1p-126f, most_float);
        const double r = std::sqrt(double{reach}) * (1.0 + 0x1p-19) + frame.error;
        return static_cast<float>(min_of(r * r * (1.0 + 0x1p-19) + 0x1p-126, double{most_float}));
    }
    template <class Node>
    HWY_INLINE std::uint32_t near(const Frame& frame, const Node& node, float limit,
                                  float* keys) const {
        std::uint32_t bits = 0;
        for (std::size_t l = 0; l < 8; l += lanes8) {
            hn::Vec<F8> off[3];
            for (int axis = 0; axis < 3; ++axis) {
                const Planes planes = planes_of(node, axis, l);
                off[axis] = hn::Max(hn::Max(hn::Sub(planes.lo, frame.most[axis]),
                                            hn::Sub(frame.least[axis], planes.hi)),
                                    hn::Zero(f8));
            }
            hn::Vec<F8> key;
            if (frame.placed)
                key = hn::MulAdd(hn::Mul(frame.weight[2], off[2]), off[2],
                                 hn::MulAdd(hn::Mul(frame.weight[1], off[1]), off[1],
                                            hn::Mul(hn::Mul(frame.weight[0], off[0]), off[0])));
            else
                key =
                    hn::MulAdd(off[2], off[2], hn::MulAdd(off[1], off[1], hn::Mul(off[0], off[0])));
            hn::Store(key, f8, keys + l);
            bits |= bits_of_le(key, hn::Set(f8, limit)) << l;
        }
        return bits & slots_of(node);
    }
    HWY_INLINE bool triangles(const TriangleBlock& block, std::uint32_t lanes, const MeshTree& mesh,
                              std::uint32_t number, bool turned) {
        NearPoints points;
        for (std::uint32_t left =
                 points_within(block, lanes, query_, sink_.reach(), sink_.tangent(), points);
             left != 0; left &= left - 1) {
            const auto lane = static_cast<std::uint32_t>(std::countr_zero(left));
            if (sink_.take(points, lane, block.prim[lane], mesh, number, turned)) return true;
        }
        return false;
    }
    /// Whether a leaf of triangles brought something closer since the last call.
    [[nodiscard]] bool improved() requires requires(Sink sink) { sink.improved(); }
    { return sink_.improved(); }
    HWY_NOINLINE bool shapes(const ShapeTree& tree, std::uint32_t place, std::uint32_t count,
                             const NearSpace* space, std::uint32_t number) {
        for (std::uint32_t k = place; k < place + count; ++k) {
            const Capsule capsule =
                tree.spheres.empty() ? tree.capsules[k] : capsule_of(tree.spheres[k]);
            ShapePoint point;
            if (space != nullptr)
                point = closest_on_image(space->way->map, capsule, query_);
            else
                point = closest_on_capsule(Double3(capsule.a), Double3(capsule.b), capsule.radius,
                                           query_);
            if (point.d2 <= sink_.reach() && sink_.take_shape(point, tree.part[k], tree.id, number))
                return true;
        }
        return false;
    }

private:
    static float largest(Vec3 p) {
        return max_of(max_of(std::fabs(p.x), std::fabs(p.y)), std::fabs(p.z));
    }

    const Vec3 query_;
    Sink& sink_;
    const bool far_;
};

/// Which geometry a triangle of a tree belongs to, and its number there.
struct TriangleName {
    std::uint32_t geometry, prim;
    TriangleName(const MeshTree& mesh, std::uint32_t triangle) {
        const std::size_t m = mesh.first.size() == 1 ? 0 : mesh.mesh_of(triangle);
        geometry = mesh.ids[m];
        prim = triangle - mesh.first[m];
    }
};

/// Keeps the closest.
class ClosestSink {
public:
    ClosestSink(Vec3 query, float limit) : query_(query), best_{limit} {}
    [[nodiscard]] float reach() const { return best_.d2; }
    [[nodiscard]] const Tangent& tangent() const { return tangent_; }
    [[nodiscard]] const NearBest& best() const { return best_; }
    /// Whether there is a new one since the last call.
    [[nodiscard]] bool improved() { return std::exchange(improved_, false); }

    HWY_INLINE bool take(const NearPoints& p, std::uint32_t lane, std::uint32_t triangle,
                         const MeshTree& mesh, std::uint32_t number, bool turned) {
        if (!(p.d2[lane] <= best_.d2)) return false;  // one of the same leaf was closer
        const TriangleName name(mesh, triangle);
        keep({p.d2[lane],
              number,
              name.geometry,
              name.prim,
              {p.x[lane], p.y[lane], p.z[lane]},
              turned ? p.v[lane] : p.u[lane],
              turned ? p.u[lane] : p.v[lane]});
        return false;
    }
    HWY_INLINE bool take_shape(const ShapePoint& p, std::uint32_t prim, std::uint32_t geometry,
                               std::uint32_t number) {
        keep({p.d2, number, geometry, prim, p.position, p.u, 0});
        improved_ = false;  // no leaf of triangles
        return false;
    }

private:
    HWY_INLINE void keep(const NearBest& other) {
        if (!(other.d2 < best_.d2) && !(other.name() < best_.name())) return;
        best_ = other;
        tangent_ = {query_, best_.position, best_.d2};
        improved_ = true;
    }
    const Vec3 query_;
    NearBest best_;
    Tangent tangent_;
    bool improved_ = false;
};

/// Takes what is touched: all, or the first.
class TouchSink {
public:
    TouchSink(float limit, BudgetVector<ScenePrimitive>* found) : limit_(limit), found_(found) {}
    [[nodiscard]] float reach() const { return limit_; }
    [[nodiscard]] static Tangent tangent() { return {}; }
    [[nodiscard]] bool any() const { return any_; }

    HWY_INLINE bool take(const NearPoints&, std::uint32_t, std::uint32_t triangle,
                         const MeshTree& mesh, std::uint32_t number, bool) {
        return take_triangle(triangle, mesh, number);
    }
    HWY_INLINE bool take_triangle(std::uint32_t triangle, const MeshTree& mesh,
                                  std::uint32_t number) {
        const TriangleName name(mesh, triangle);
        return take_name({number, name.geometry, name.prim});
    }
    HWY_INLINE bool take_shape(const ShapePoint&, std::uint32_t prim, std::uint32_t geometry,
                               std::uint32_t number) {
        return take_name({number, geometry, prim});
    }
    bool take_name(const ScenePrimitive& name) {
        any_ = true;
        if (found_ == nullptr) return true;
        found_->push_back(name);
        return false;
    }

private:
    float limit_;
    BudgetVector<ScenePrimitive>* found_;
    bool any_ = false;
};

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
                   std::uint32_t number, bool) {
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
                   std::uint32_t number, bool turned) {
        for (; lanes != 0; lanes &= lanes - 1) {
            const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
            const LeafTriangle triangle = triangle_of(block, lane);
            TriangleHit hit{};
            if (!meet(triangle, hit)) continue;
            const TriangleName name(mesh, block.prim[lane]);
            const NearContact contact{hit.t,    number, name.geometry, name.prim,
                                      triangle, hit.u,  hit.v,         turned};
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
