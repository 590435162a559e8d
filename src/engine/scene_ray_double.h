// One ray in double through a scene: down its wide tree over parts, at each part through the
// inverses of instances into it, and on from there. Included once per instruction set.
#if defined(RAYDIX_ENGINE_SCENE_RAY_DOUBLE_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_SCENE_RAY_DOUBLE_H
#undef RAYDIX_ENGINE_SCENE_RAY_DOUBLE_H
#else
#define RAYDIX_ENGINE_SCENE_RAY_DOUBLE_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "engine/box_frame_double.h"
#include "engine/hit_order.h"
#include "engine/scene_job_double.h"
#include "engine/shape_tree.h"
#include "engine/triangle_leaves_double.h"
#include "proximity/shape_hits.h"
#include "trace/simd/single.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// The class of a ray in double, but for signs.
HWY_INLINE RayClass class_of(const RayFrameD& ray) {
    return {0, static_cast<std::uint32_t>(ray.kx), static_cast<std::uint32_t>(ray.ky),
            static_cast<std::uint32_t>(ray.kz)};
}

/// A ray in the space of a tree of triangles.
struct RayAtTriangles {
    TriangleLineD line;
    RayClass kind;
    BestD best;
    double t_scale;  // t of the caller's ray = t_scale * t here
    SingleFrame boxes;
    BoxDistances distances;

    /// `ray` must be valid. False if it ends before it comes to the tree.
    HWY_INLINE bool fill(const WideTreeD& tree, const RayD& ray) {
        const RayFrameD frame = make_frame(ray);
        line = TriangleLineD(frame);
        kind = class_of(frame);
        best = {frame.tmax};
        t_scale = frame.t_scale;
        return fill_box_frame(tree, ray, frame, 0.0, boxes, distances);
    }
    /// What the scene says of the best hit, which there must be.
    [[nodiscard]] HWY_INLINE HitD hit(const MeshTreeD& mesh, std::uint32_t number) const {
        return hit_of(mesh, number, best.t, best.prim, best.u / best.area, best.v / best.area);
    }
    [[nodiscard]] HWY_INLINE HitD hit_of(const MeshTreeD& mesh, std::uint32_t number, double t,
                                         std::uint32_t prim, double u, double v) const {
        HitD found{TreeHitD{t * t_scale + 0.0, prim, u, v}, no_primitive, number};
        mesh.name(found);
        return found;
    }
};

/// Into a placed scene, by all of its instances in turn.
HWY_INLINE LineD line_into(const LineD& line, const SceneTreeD& scene, const PlacedSceneD& placed) {
    LineD inside = line.into(placed.way.inverse);
    for (std::uint32_t k = 0; k < placed.more; ++k)
        inside = inside.into(scene.ways[placed.first + k].inverse);
    return inside;
}

template <Wanted wanted>
class SceneRayD {
public:
    /// The ray must be valid; `place`: among the caller's; `stack` has room for
    /// SceneTreeD::stack_size. `found`: of all hits.
    SceneRayD(const RayD& ray, std::size_t place, std::uint32_t mask, const WideStackView& stack,
              BudgetVector<HitD>* found = nullptr)
        : mask_(mask),
          tmin_(ray.tmin),
          reach_(ray.tmax),
          stack_(stack),
          found_(found),
          place_(place) {}

    /// Says which hits count. Both must outlive the walk.
    void filter_by(const HitFilterD& filter, const RayD& ray) { filter_ = &filter, given_ = &ray; }

    [[nodiscard]] const HitD& best() const { return best_; }

    /// `ray` is that of the constructor.
    void trace(const SceneTreeD& scene, const RayD& ray) {
        if (const MeshTreeD* const mesh = scene.only_mesh())
            hit_mesh(*mesh, 0, ray);
        else
            walk(scene, 0, LineD(ray));
    }

protected:
    void walk(const SceneTreeD& scene, std::uint32_t number, const LineD& line) {
        if (const MeshTreeD* const mesh = scene.only_mesh())
            hit_mesh(*mesh, number, line);
        else if (!scene.parts.empty())
            walk_parts(scene, number, line);
    }

    /// Whether rays of its mask see all instances on the way.
    [[nodiscard]] bool sees(const SceneTreeD& scene, const PlacedSceneD& placed) const {
        bool seen = (placed.way.mask & mask_) != 0;
        for (std::uint32_t k = 0; k < placed.more; ++k)
            seen = seen && (scene.ways[placed.first + k].mask & mask_) != 0;
        return seen;
    }

    struct Parts {
        SceneRayD& ray;
        const SceneTreeD& scene;
        const std::uint32_t number;
        const LineD& line;
        const double t_scale;
        const BoxDistances& distances;
        static constexpr bool large = false, nearest_first = false;

        HWY_NOINLINE float visit_one(std::uint32_t leaf, std::uint32_t, std::uint32_t) {
            ray.visit(scene, scene.parts.part[leaf], number, line);
            if (wants_any(wanted) && ray.best_.hit()) return -1.0f;
            return distances.above(ray.reach_ / t_scale);
        }
    };

    HWY_NOINLINE void walk_parts(const SceneTreeD& scene, std::uint32_t number, const LineD& line) {
        const RayD ray = line.ray(tmin_, reach_);
        if (!is_valid(ray)) return;
        const RayFrameD frame = make_frame(ray);
        SingleFrame boxes;
        BoxDistances distances;
        if (!fill_box_frame(scene.parts, ray, frame, scene.parts.around.error, boxes, distances))
            return;
        const WideStackView stack = stack_;
        const std::size_t taken = wide_stack_capacity(scene.parts.arrays.stats.max_depth);
        stack_ = stack.from(taken);
        Parts parts{*this, scene, number, line, frame.t_scale, distances};
        SimdCounts counts;
        SingleRay<wanted, false, false, false, Parts>(scene.parts.view, boxes, stack, counts,
                                                      &parts)
            .trace(0, {boxes.tmax});
        stack_ = stack;
    }

    void visit(const SceneTreeD& scene, std::uint32_t part, std::uint32_t number,
               const LineD& line) {
        if (part < scene.meshes.size()) {
            hit_mesh(*scene.meshes[part], number, line);
            return;
        }
        const std::size_t own = scene.own_part_count();
        if (part < own) {
            hit_shapes(*scene.shapes[part - scene.meshes.size()], number, line);
            return;
        }
        const PlacedSceneD& placed = scene.placed[part - own];
        if (sees(scene, placed))
            walk(*placed.scene, number + placed.number, line_into(line, scene, placed));
    }

    void hit_mesh(const MeshTreeD& mesh, std::uint32_t number, const LineD& line) {
        const RayD ray = line.ray(tmin_, reach_);
        if (is_valid(ray)) hit_mesh(mesh, number, ray);
    }
    HWY_NOINLINE void hit_mesh(const MeshTreeD& mesh, std::uint32_t number, const RayD& ray) {
        const WideTreeD& tree = *mesh.tree;
        if (tree.empty() || (mesh.mask & mask_) == 0) return;
        RayAtTriangles at;
        if (!at.fill(tree, ray)) return;
        const auto take = [&](double t, std::uint32_t prim, double u, double v) {
            const HitD hit = at.hit_of(mesh, number, t, prim, u, v);
            if constexpr (wants_accepted(wanted)) return (*filter_)(place_, *given_, hit);
            found_->push_back(hit);
            return false;
        };
        using Leaves = TriangleLeavesD<wanted, decltype(take)>;
        Leaves leaves(tree, at.line, at.kind, at.distances, at.best, take);
        SimdCounts counts;
        const WideBest last = SingleRay<wanted, false, false, false, Leaves>(
                                  tree.view, at.boxes, stack_, counts, &leaves)
                                  .trace(0, {at.boxes.tmax});
        if constexpr (wants_any(wanted)) {
            if (last.t < 0) best_.prim = 0;
        } else if (at.best.found()) {
            keep(at.hit(mesh, number));
        }
    }

    /// What the ray does at the leaves of a tree over shapes.
    struct AtShapes {
        SceneRayD& ray;
        const ShapeTreeD& tree;
        const std::uint32_t number;
        RayD line;  // tmax: as far as it still goes
        const double t_scale;
        const BoxDistances& distances;
        static constexpr bool large = false, nearest_first = false;

        HWY_NOINLINE float visit_one(std::uint32_t place, std::uint32_t, std::uint32_t) {
            ray.hit_primitive(tree, tree.part[place], number, line);
            if (wants_any(wanted) && ray.best_.hit()) return -1.0f;
            line.tmax = ray.reach_;
            return distances.above(ray.reach_ / t_scale);
        }
    };

    HWY_NOINLINE void hit_shapes(const ShapeTreeD& tree, std::uint32_t number, const LineD& line) {
        if (tree.empty() || (tree.mask & mask_) == 0) return;
        RayD ray = line.ray(tmin_, reach_);
        if (!is_valid(ray)) return;
        const RayFrameD frame = make_frame(ray);
        SingleFrame boxes;
        BoxDistances distances;
        if (!fill_box_frame(tree, ray, frame, tree.around.error, boxes, distances)) return;
        ray.tmin = max_of(ray.tmin, 0.0) + 0.0;  // -0 becomes +0
        AtShapes shapes{*this, tree, number, ray, frame.t_scale, distances};
        SimdCounts counts;
        SingleRay<wanted, false, false, false, AtShapes>(tree.view, boxes, stack_, counts, &shapes)
            .trace(0, {boxes.tmax});
    }

    void hit_primitive(const ShapeTreeD& tree, std::uint32_t prim, std::uint32_t number,
                       const RayD& ray) {
        TreeHitD hit;
        if (const UserGeometryD* const user = tree.user()) {
            RaysAtPrimitiveD rays(&ray, &place_, &hit, 1);
            user->test(prim, rays);
            if (!hit.hit()) return;
        } else if (const auto* const capsules =
                       std::get_if<std::span<const CapsuleD>>(&tree.shapes)) {
            if (!hit_capsule((*capsules)[prim], ray, hit)) return;
        } else if (!tree.with_capsule(prim, [&](Vec3d center, Vec3d, double radius) {
                       return hit_ball(center, radius, ray, hit);
                   })) {
            return;
        }
        hit.prim = prim;
        take({hit, tree.id, number});
    }
    void take(const HitD& hit) {
        if constexpr (wanted == Wanted::all) {
            found_->push_back(hit);
            return;
        }
        if constexpr (wants_accepted(wanted))
            if (!(*filter_)(place_, *given_, hit)) return;
        if constexpr (wants_any(wanted))
            best_.prim = 0;
        else
            keep(hit);
    }

    void keep(const HitD& hit) {
        if (best_.hit() && !(order_of(hit) < order_of(best_))) return;
        best_ = hit;
        // What differs on the way in may be equal in the caller's units where those are subnormal:
        // it must be found too, up to the end that the caller gave.
        reach_ = hit.t < std::numeric_limits<double>::min()
                     ? std::min(reach_, std::nextafter(hit.t, 1.0))
                     : hit.t;
    }

    const std::uint32_t mask_;
    const double tmin_;
    double reach_;
    HitD best_;
    WideStackView stack_;  // from where it is free
    BudgetVector<HitD>* const found_;
    const HitFilterD* filter_ = nullptr;
    const std::size_t place_;
    const RayD* given_ = nullptr;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
