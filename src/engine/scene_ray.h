// One ray through a scene: down its tree over parts, at each part through the inverses of instances
// into it, and on from there. Included once per instruction set.
#if defined(RAYDIX_ENGINE_SCENE_RAY_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_SCENE_RAY_H
#undef RAYDIX_ENGINE_SCENE_RAY_H
#else
#define RAYDIX_ENGINE_SCENE_RAY_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <limits>

#include "base/plain_scale.h"
#include "engine/hit_order.h"
#include "engine/scene_job.h"
#include "engine/shape_leaves.h"
#include "trace/simd/lanes_double.h"
#include "trace/simd/single_calls.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// What the scene says of a hit of a tree. Tree: of a mesh or of shapes.
template <class Tree>
HWY_INLINE Hit hit_in_scene(const Tree& tree, std::uint32_t number, double scale,
                            const TreeHit& hit) {
    Hit found{hit, no_primitive, number};
    if (scale != 1.0) found.t = static_cast<float>(double{hit.t} * scale) + 0.0f;
    tree.name(found);
    return found;
}

/// A hit of a tree takes the place of the best one if it is the less of the two; `reach` is how far
/// the ray goes then. Whether it does.
template <bool any, class Tree>
HWY_INLINE bool keep(const Tree& tree, std::uint32_t number, double scale, const TreeHit& hit,
                     Hit& best, float& reach) {
    if constexpr (any) {
        best.prim = 0;
        reach = -1.0f;
        return true;
    }
    Hit found{hit, no_primitive, number};
    if (scale != 1.0) found.t = static_cast<float>(double{hit.t} * scale) + 0.0f;
    if (best.hit() && found.t > best.t) return false;
    tree.name(found);
    if (best.hit() && !(order_of(found) < order_of(best))) return false;
    best = found;
    // What differs in the line may be equal in the caller's units where those are subnormal: it
    // must be found too, up to the end that the caller gave.
    reach = found.t < std::numeric_limits<float>::min()
                ? min_of(reach, std::nextafterf(found.t, infinity))
                : found.t;
    return true;
}

HWY_INLINE bool near_unit_length(double longest) { return longest > 0x1p-3 && longest < 0x1p3; }
/// False also for some whose longest component is 2^-3 or 2^3 but for a rounding, and for NaN.
HWY_INLINE bool near_unit_length(V4 way) {
    const V4 size = hn::Abs(way);
    return (bits_of(f4, hn::Lt(size, hn::Set(f4, 0x1p3f))) & 7) == 7 &&
           (bits_of(f4, hn::Gt(size, hn::Set(f4, 0x1p-3f))) & 7) != 0;
}

/// As direction_scale. As large a one as brings a direction that floats hold near unit length:
/// distances and short components are then in the range of floats wherever the caller's are.
inline double line_scale(double longest) {
    if (is_plainly_scaled(longest) && !near_unit_length(longest)) return plain_scale(longest);
    return longest >= 0x1p125 && longest < 0x1p128 ? 0x1p-125 : direction_scale(longest);
}

/// Scales beyond this are those of subnormal directions. The triangle test of a ray on its own
/// (trace/ray_frame.h) has no larger one, and what it rounds t to there is what counts.
constexpr double largest_ray_scale = 0x1p125;
inline HWY_NOINLINE const SceneLine& with_ray_scale(const SceneLine& line, std::uint32_t number,
                                                    SceneLine& room) {
    if (number != 0) return line;
    room = line;
    for (double& d : room.direction) d *= largest_ray_scale / line.scale;
    room.scale = largest_ray_scale;
    return room;
}
/// A line as a scene's own meshes meet it, on path `number`; `room` is for a line that changes.
HWY_INLINE const SceneLine& line_at_mesh(const SceneLine& line, std::uint32_t number,
                                         SceneLine& room) {
    if (HWY_UNLIKELY(line.scale > largest_ray_scale)) return with_ray_scale(line, number, room);
    return line;
}

/// Brings a line's direction near unit length, as floats see it: rounding to them may take the
/// longest component up to 2^3, or down to 2^-3.
inline HWY_NOINLINE void rescale(SceneLine& line) {
    const double longest =
        max_of(max_of(std::fabs(line.direction[0]), std::fabs(line.direction[1])),
               std::fabs(line.direction[2]));
    const double by = line_scale(near_unit_length(longest) ? static_cast<float>(longest) : longest);
    for (int a = 0; a < 3; ++a) line.direction[a] *= by;
    line.scale *= by;
}

/// Floats that hold a ray, in double.
template <class D = D4>
HWY_INLINE void widen(V4 from, double* to) {
    const D d;
    if constexpr (hn::MaxLanes(d) == 4) {
        hn::Store(hn::PromoteTo(d, from), d, to);
    } else {
        alignas(16) float axes[4];
        hn::Store(from, f4, axes);
        for (int a = 0; a < 4; ++a) to[a] = double{axes[a]};
    }
}
HWY_INLINE void set_line(const Ray& ray, double scale, SceneLine& line) {
    const auto axes = hn::FirstN(f4, 3);
    widen(hn::IfThenElseZero(axes, load_axes(&ray.origin.x)), line.origin);
    widen(hn::IfThenElseZero(axes, load_axes(&ray.direction.x)), line.direction);
    line.scale = scale;
}

/// The caller's ray.
HWY_INLINE SceneLine line_of(const Ray& ray) {
    SceneLine line;
    set_line(ray, 1.0, line);
    if (!near_unit_length(load_axes(&ray.direction.x))) rescale(line);
    return line;
}

/// Through the inverse of an instance: ((x + y) + z) + move, nothing fused. `from` may be `to`.
HWY_INLINE void enter(const SceneLine& from, const WayIn& way, SceneLine& to) {
    const D4 d;
    const double o[3] = {from.origin[0], from.origin[1], from.origin[2]},
                 v[3] = {from.direction[0], from.direction[1], from.direction[2]};
    to.scale = from.scale;
    for (std::size_t l = 0; l < 4; l += hn::MaxLanes(d)) {
        const auto x = hn::Load(d, way.columns[0] + l), y = hn::Load(d, way.columns[1] + l),
                   z = hn::Load(d, way.columns[2] + l);
        const auto turned = [&](const double* by) {
            return hn::Add(hn::Add(hn::Mul(x, hn::Set(d, by[0])), hn::Mul(y, hn::Set(d, by[1]))),
                           hn::Mul(z, hn::Set(d, by[2])));
        };
        hn::Store(hn::Add(turned(o), hn::Load(d, way.columns[3] + l)), d, to.origin + l);
        hn::Store(turned(v), d, to.direction + l);
    }
    if (!near_unit_length(rounded(to.direction))) rescale(to);
}

/// Into a placed scene, by all of its instances in turn.
HWY_INLINE void enter(const SceneLine& from, const SceneTree& scene, const PlacedScene& placed,
                      SceneLine& to) {
    enter(from, placed.way, to);
    for (std::uint32_t k = 0; k < placed.more; ++k) enter(to, scene.ways[placed.first + k], to);
}

/// Whether rays of a mask see all instances on the way.
HWY_INLINE bool sees(std::uint32_t mask, const SceneTree& scene, const PlacedScene& placed) {
    bool seen = (placed.way.mask & mask) != 0;
    for (std::uint32_t k = 0; k < placed.more; ++k)
        seen = seen && (scene.ways[placed.first + k].mask & mask) != 0;
    return seen;
}

/// The largest lane of four, in all of them.
HWY_INLINE V4 largest(V4 v) {
    const V4 pairs = hn::Max(v, hn::Shuffle2301(v));
    return hn::Max(pairs, hn::Shuffle1032(pairs));
}

/// What boxes and triangles need of a ray near unit length, as fill_usual_frame has it but for pads
/// that are a little larger. A fourth component of both is 0. False if floats do not hold the ray.
HWY_INLINE bool fill_scene_frame(const WideView& tree, V4 place, V4 way, PadGrowth growth,
                                 SingleFrame& out) {
    const V4 most = hn::Set(f4, std::numeric_limits<float>::max());
    if ((bits_of(f4, hn::And(hn::Le(hn::Abs(place), most), hn::Le(hn::Abs(way), most))) & 7) != 7)
        return false;
    const hn::RebindToSigned<F4> i4;
    const std::uint32_t negatives = bits_of(i4, hn::Lt(hn::BitCast(i4, way), hn::Zero(i4))) & 7;
    const V4 size = hn::Abs(way);
    const std::uint32_t longest = bits_of(f4, hn::Eq(size, largest(size))) & 7;
    const auto kz = static_cast<std::uint32_t>(std::bit_width(longest)) - 1;
    out.kind = ray_classes[negatives + 8 * kz];
    const V4 origin = hn::Add(place, hn::Zero(f4));  // -0 becomes +0
    const V4 inverse = limited(hn::Div(hn::Set(f4, 1.0f), way));
    const V4 reach = hn::Max(hn::Abs(hn::Sub(hn::Load(f4, tree.lo), origin)),
                             hn::Abs(hn::Sub(hn::Load(f4, tree.hi), origin)));
    const V4 farthest = largest(reach);
    constexpr float rate = wide_pad_factor * slab_pad;
    const V4 pad = hn::Add(
        hn::MulAdd(farthest, hn::Set(f4, rate + growth.rate), hn::Mul(reach, hn::Set(f4, rate))),
        hn::Set(f4, least_slab_pad + growth.least));
    const V4 near_pad = hn::CopySignToAbs(pad, hn::Neg(way));
    hn::Store(origin, f4, out.origin);
    hn::Store(way, f4, out.direction);
    hn::Store(inverse, f4, out.inverse);
    hn::Store(near_pad, f4, out.near_pad);
    set_starts(tree, origin, inverse, near_pad, out);
    alignas(16) float shears[4];
    hn::Store(hn::Div(way, hn::Set(f4, out.direction[kz])), f4, shears);
    out.shear[0] = shears[out.kind.kx], out.shear[1] = shears[out.kind.ky];
    out.t_scale = 1.0f;
    return true;
}

/// One ray through a scene; counting: the nodes that it visits too.
template <Wanted wanted, bool counting = false>
class SceneRay {
public:
    /// `place`: among the caller's rays; `stack` has room for SceneTree::stack_size; `best` is what
    /// was found before; `found` is for all hits.
    SceneRay(const SceneJob::Limits& limits, std::size_t place, const Hit& best,
             const WideStackView& stack, BudgetVector<Hit>* found = nullptr,
             bool nearest_first = true)
        : place_(place),
          tmin_(limits.tmin),
          reach_(limits.reach),
          mask_(limits.mask),
          best_(best),
          stack_(stack),
          found_(found),
          nearest_first_(nearest_first) {}

    /// Says which hits count; `ray` is the caller's. Both must outlive the walk.
    void filter_by(const HitFilter& filter, const Ray& ray) { filter_ = &filter, given_ = &ray; }

    /// For single calls through one geometry of shapes: rays that are like those of the last calls
    /// take much the same way, and often find any hit where they enter first.
    void come_after(CallHistory& history) { history_ = &history; }

    [[nodiscard]] const Hit& best() const { return best_; }
    void store(SceneJob& job, std::uint32_t id) const {
        job.limits[id].reach = reach_;
        job.hits[id] = best_;
    }
    [[nodiscard]] std::uint64_t visits() const { return visits_; }

    void walk(const SceneTree& scene, std::uint32_t number, const SceneLine& line) {
        if (const MeshTree* const mesh = scene.only_mesh()) {
            SceneLine room;
            if (!mesh->tree->empty()) hit_mesh(*mesh, number, line_at_mesh(line, number, room));
            return;
        }
        if (const ShapeTree* const shapes = scene.only_shapes()) {
            if (!shapes->empty()) hit_shapes(*shapes, number, line);
            return;
        }
        for (const PartTree* const tree : {&scene.near, &scene.wild})
            if (!tree->empty()) walk_parts(scene, *tree, number, line);
    }

    /// Part `part` of a scene.
    HWY_INLINE void visit(const SceneTree& scene, std::uint32_t part, std::uint32_t number,
                          const SceneLine& line) {
        const std::size_t meshes = scene.meshes.size();
        SceneLine inside;
        if (part < meshes) {
            hit_mesh(*scene.meshes[part], number, line_at_mesh(line, number, inside));
            return;
        }
        const std::size_t own = scene.own_part_count();
        if (part < own) {
            hit_shapes(*scene.shapes[part - meshes], number, line);
            return;
        }
        const PlacedScene& placed = scene.placed[part - own];
        if (!sees(mask_, scene, placed)) return;
        enter(line, scene, placed, inside);
        number += placed.number;
        if (placed.mesh != nullptr)
            hit_mesh(*placed.mesh, number, inside);
        else
            walk(*placed.scene, number, inside);
    }

protected:
    struct Parts {
        SceneRay& ray;
        const SceneTree& scene;
        const PartTree& tree;
        std::uint32_t number;
        const SceneLine& line;
        bool nearest_first;
        static constexpr bool large = false;

        HWY_NOINLINE float visit_one(std::uint32_t leaf, std::uint32_t, std::uint32_t) {
            ray.visit(scene, tree.part[leaf], number, line);
            return min_of(line.end(ray.reach_), std::numeric_limits<float>::max());
        }
    };

    HWY_NOINLINE void walk_parts(const SceneTree& scene, const PartTree& tree, std::uint32_t number,
                                 const SceneLine& line) {
        SingleFrame frame;
        if (!fill(tree.view, line, tree.growth, frame)) return;
        const WideStackView stack = stack_;
        const std::size_t taken = wide_stack_capacity(tree.arrays.stats.max_depth);
        stack_ = stack.from(taken);
        Parts parts{*this, scene, tree, number, line, nearest_first_};
        SimdCounts counts;
        SingleRay<wanted, counting, false, false, Parts>(tree.view, frame, stack, counts, &parts, 0)
            .trace(0, {frame.tmax});
        if constexpr (counting) visits_ += counts.visits;
        stack_ = stack;
    }

    /// False if floats do not hold the ray, or it ends before it begins.
    HWY_INLINE bool fill(const WideView& view, const SceneLine& line, PadGrowth growth,
                         SingleFrame& frame) const {
        const float tmin = line.start(tmin_), tmax = line.end(reach_);
        if (!(tmin <= tmax && tmax >= 0.0f)) return false;
        frame.tmin = tmin > 0.0f ? tmin : 0.0f;
        frame.tmax = min_of(tmax, std::numeric_limits<float>::max());
        return fill_scene_frame(view, rounded(line.origin), rounded(line.direction), growth, frame);
    }

    /// Of a mesh that is not empty.
    HWY_INLINE void hit_mesh(const MeshTree& mesh, std::uint32_t number, const SceneLine& line) {
        if ((mesh.mask & mask_) == 0) return;
        SingleFrame frame;
        if (!fill(mesh.view, line, {}, frame)) return;
        if (mesh.view.is_compact) {
            TriangleBlock room{};
            WideView view = mesh.view;
            view.room = &room;
            search<true>(mesh, view, frame, number, line.scale);
        } else {
            search<false>(mesh, mesh.view, frame, number, line.scale);
        }
    }

    /// What the ray does at the leaves of a tree over shapes.
    struct AtShapes {
        SceneRay& ray;
        const ShapeTree& tree;
        std::uint32_t number;
        ShapeRay at;
        bool nearest_first;
        static constexpr bool large = true;

        [[nodiscard]] bool is_at_hand() const { return tree.is_at_hand; }
        RAYDIX_PREFETCHING void ask_for(std::uint32_t word) const { ask_for_shapes(tree, word); }
        float visit_one(std::uint32_t place, std::uint32_t count, std::uint32_t) {
            ray.hit_primitives(tree, place, count, number, at);
            return reach();
        }
        [[nodiscard]] float reach() const {
            return min_of(at.ray.tmax, std::numeric_limits<float>::max());
        }
    };

    /// Of shapes that are not empty.
    HWY_NOINLINE void hit_shapes(const ShapeTree& tree, std::uint32_t number,
                                 const SceneLine& line) {
        if ((tree.mask & mask_) == 0) return;
        SingleFrame frame;
        if (!fill(tree.view, line, tree.growth, frame)) return;
        AtShapes shapes{*this, tree, number, shape_ray(line, frame), false};
        if constexpr (wanted != Wanted::all && !counting) {
            if (history_ != nullptr && follows(tree.view, frame, *history_)) {
                shapes.nearest_first = !tree.is_at_hand;
                walk_shapes<true>(tree, frame, shapes);
                return;
            }
        }
        walk_shapes<false>(tree, frame, shapes);
    }
    template <bool guessing>
    HWY_INLINE void walk_shapes(const ShapeTree& tree, const SingleFrame& frame, AtShapes& shapes) {
        SimdCounts counts;
        SingleRay<wanted, counting, false, guessing, AtShapes>(tree.view, frame, stack_, counts,
                                                               &shapes, 0)
            .trace(0, {frame.tmax});
        if constexpr (counting) visits_ += counts.visits;
    }
    /// `frame` is the line's.
    HWY_INLINE ShapeRay shape_ray(const SceneLine& line, const SingleFrame& frame) const {
        const float *const o = frame.origin, *const d = frame.direction;
        return {
            {{o[0], o[1], o[2]}, frame.tmin, {d[0], d[1], d[2]}, frame.tmax}, line.scale, place_};
    }

    /// Those that a leaf names; `at` ends where the best hit is then.
    HWY_INLINE void hit_primitives(const ShapeTree& tree, std::uint32_t place, std::uint32_t count,
                                   std::uint32_t number, ShapeRay& at) {
        if (const UserGeometry* const user = tree.user()) {
            hit_user(*user, tree, place, number, at);
            return;
        }
        hit_leaf(tree, place, count, at,
                 [&](const TreeHit& hit) { return take(tree, number, at.scale, hit, at); });
    }
    /// A hit in units of `scale`. Whether the ray is done.
    HWY_INLINE bool take(const ShapeTree& tree, std::uint32_t number, double scale,
                         const TreeHit& hit, ShapeRay& at) {
        if constexpr (wanted == Wanted::all) {
            Hit found{hit, tree.id, number};
            found.t = static_cast<float>(double{hit.t} * scale) + 0.0f;
            found_->push_back(found);
            return false;
        }
        if constexpr (wants_accepted(wanted))
            if (!accepts(hit_in_scene(tree, number, scale, hit))) return false;
        if (keep<wants_any(wanted)>(tree, number, scale, hit, best_, reach_)) at.end_at(reach_);
        return wants_any(wanted);
    }
    [[nodiscard]] bool accepts(const Hit& hit) const { return (*filter_)(place_, *given_, hit); }

    /// Asks the filter about hits of a mesh.
    struct MeshCheck {
        const SceneRay& ray;
        const MeshTree& mesh;
        std::uint32_t number;
        double scale;

        static bool accepts(const void* context, const Ray*, const TreeHit& hit) {
            const auto& check = *static_cast<const MeshCheck*>(context);
            return check.ray.accepts(hit_in_scene(check.mesh, check.number, check.scale, hit));
        }
    };
    HWY_NOINLINE void hit_user(const UserGeometry& user, const ShapeTree& tree, std::uint32_t prim,
                               std::uint32_t number, ShapeRay& at) {
        UserRay given(at.ray, at.scale, tmin_, reach_);
        TreeHit hit;
        RaysAtPrimitive rays(&given.ray, &at.place, &hit, 1);
        user.test(prim, rays);
        if (!hit.hit()) return;
        hit.prim = prim;
        take(tree, number, given.scale, hit, at);
    }

    template <bool compact>
    HWY_INLINE void search(const MeshTree& mesh, const WideView& view, const SingleFrame& frame,
                           std::uint32_t number, double scale) {
        constexpr bool counted = compact || counting;
        SimdCounts counts;
        if constexpr (wanted == Wanted::all) {
            const std::size_t before = found_->size();
            SingleRay<wanted, counted, compact> ray(view, frame, stack_, counts);
            ray.collect(*found_);
            ray.trace(0, {frame.tmax});
            for (std::size_t k = before; k < found_->size(); ++k) {
                Hit& hit = (*found_)[k];
                hit.t = static_cast<float>(double{hit.t} * scale) + 0.0f;
                hit.instance = number;
                mesh.name(hit);
            }
        } else {
            SingleRay<wanted, counted, compact> ray(view, frame, stack_, counts);
            const MeshCheck context{*this, mesh, number, scale};
            const HitCheck check{&MeshCheck::accepts, &context};
            if constexpr (wants_accepted(wanted)) ray.check_by(check, nullptr);
            const WideBest best = ray.trace(0, {frame.tmax});
            if (best.found())
                keep<wants_any(wanted)>(mesh, number, scale, {best.t, best.prim, best.u, best.v},
                                        best_, reach_);
        }
        if constexpr (counting) visits_ += counts.visits;
    }

    const std::size_t place_;
    const float tmin_;
    float reach_;
    const std::uint32_t mask_;
    Hit best_;
    std::uint64_t visits_ = 0;
    WideStackView stack_;  // from where it is free
    BudgetVector<Hit>* const found_;
    const bool nearest_first_;  // see single.h
    const HitFilter* filter_ = nullptr;
    const Ray* given_ = nullptr;
    CallHistory* history_ = nullptr;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
