// What queries of distance ask of boxes, triangles and shapes: eight boxes and four triangles at a
// time; segments and sweeps are in near_contacts.h. Included once per instruction set.
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
        const std::size_t m = mesh.mesh_of(triangle);
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

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
