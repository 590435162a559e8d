// Distance and overlap on scenes in double: through a tree over all triangles as they are in the
// world (near_body.h).
#include <raydix/double.h>
#include <raydix/scene_queries.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/near_body.h"
#include "engine/near_queries.h"
#include "proximity/sweep_hits.h"

namespace raydix {
namespace {

/// As near_queries.h has it.
class Near {
public:
    Near(const SceneD& scene, std::uint32_t mask, NearCall call, std::string_view = {},
         ResultBudget* budget = nullptr)
        : body_(near_body_of(scene, mask, call, budget)) {}

    [[nodiscard]] Buffer<std::uint32_t> order(std::span<const Vec3d> places) const {
        return query_order(body_->triangles.tree, places);
    }

    class Thread {
    public:
        explicit Thread(const Near& near)
            : names_(near.body_->triangles.names),
              tree_(near.body_->padded),
              shapes_(near.body_->shapes),
              stack_(std::max(tree_.max_depth, shapes_.max_depth())) {}

        SceneClosestPointD closest(Vec3d query, double limit) {
            SceneClosestPointD out;
            NearShapesD::Found best{{{}, 0, limit}, {no_primitive, no_primitive, no_primitive}};
            if (!tree_.empty) {
                const auto found = find_closest_triangle(tree_, query, limit, guess_, stack_);
                if (found.prim != no_primitive) {
                    guess_ = found.position;
                    out = of_triangle(found);
                    best.point.d2 = found.point.d2;
                    best.name = {out.instance, out.geometry, out.prim};
                }
            }
            if (!shapes_.empty() && shapes_.find_closest(query, best, stack_))
                out = {best.point.position,
                       std::sqrt(best.point.d2),
                       best.name.prim,
                       best.name.geometry,
                       best.name.instance,
                       best.point.u,
                       0};
            return out;
        }
        template <class Query>
        bool touch(const Query& query, BudgetVector<ScenePrimitive>* found) {
            bool any = false;
            const auto take = [&](const ScenePrimitive& name) {
                any = true;
                if (found == nullptr) return true;
                found->push_back(name);
                return false;
            };
            if (!tree_.empty)
                for_each_touched(tree_, prepared(query), stack_, [&](std::uint32_t position) {
                    return take(names_.name(tree_.order[position]));
                });
            if (!shapes_.empty() && !(any && found == nullptr))
                shapes_.for_each_touched(query, stack_, take);
            return any;
        }
        SceneSweepHitD sweep(const SphereSweepD& sweep) {
            if (tree_.empty) return {};
            const SweepHitD hit = sweep_one<DoubleSweeps>(tree_, sweep, stack_);
            if (!hit.hit()) return {};
            const FlatNames::Run& run = names_.run_of(hit.prim);
            SceneSweepHitD out{hit.t,        hit.prim - run.first, run.geometry,
                               run.instance, hit.position,         hit.u,
                               hit.v};
            if (run.turned) std::swap(out.u, out.v);
            return out;
        }

    private:
        [[nodiscard]] SceneClosestPointD of_triangle(
            const BasicClosestTriangle<double>& found) const {
            const FlatNames::Run& run = names_.run_of(found.prim);
            SceneClosestPointD out{found.point.position,   std::sqrt(found.point.d2),
                                   found.prim - run.first, run.geometry,
                                   run.instance,           found.point.u,
                                   found.point.v};
            if (run.turned) std::swap(out.u, out.v);
            return out;
        }

        const FlatNames& names_;
        const PaddedTreeD& tree_;
        const NearShapesD& shapes_;
        BasicWalkStack<double> stack_;
        std::uint32_t guess_ = no_primitive;
    };

private:
    const std::shared_ptr<const NearBodyD> body_;
};

}  // namespace

QueryCounts closest_points(const SceneD& scene, std::span<const Vec3d> queries,
                           std::span<SceneClosestPointD> results,
                           const SceneClosestOptionsD& options) {
    return closest_batch<Near>(scene, queries, results, options);
}
std::vector<SceneClosestPointD> closest_points(const SceneD& scene, std::span<const Vec3d> queries,
                                               const SceneClosestOptionsD& options) {
    std::vector<SceneClosestPointD> results(queries.size());
    closest_points(scene, queries, results, options);
    return results;
}
SceneClosestPointD closest_point(const SceneD& scene, Vec3d query, double max_distance,
                                 std::uint32_t mask) {
    const FloatEnvironment plain;
    const double limit = square_limit_of(max_distance);
    const Near near(scene, mask, NearCall::closest);
    if (!is_finite(query)) return {};
    return Near::Thread(near).closest(query, limit);
}

QueryCounts touch_any(const SceneD& scene, std::span<const SegmentD> queries,
                      std::span<std::uint8_t> touched, const SceneOverlapOptions& options) {
    return touch_any_batch<Near>(scene, queries, touched, options);
}
QueryCounts touch_any(const SceneD& scene, std::span<const SphereD> queries,
                      std::span<std::uint8_t> touched, const SceneOverlapOptions& options) {
    return touch_any_batch<Near>(scene, queries, touched, options);
}
bool touches(const SceneD& scene, const SegmentD& segment, std::uint32_t mask) {
    return touches_one<Near>(scene, segment, mask);
}
bool touches(const SceneD& scene, const SphereD& sphere, std::uint32_t mask) {
    return touches_one<Near>(scene, sphere, mask);
}

SceneOverlapLists touch_all(const SceneD& scene, std::span<const SegmentD> queries,
                            const SceneOverlapOptions& options) {
    return touch_all_batch<Near>(scene, queries, options);
}
SceneOverlapLists touch_all(const SceneD& scene, std::span<const SphereD> queries,
                            const SceneOverlapOptions& options) {
    return touch_all_batch<Near>(scene, queries, options);
}

QueryCounts sweep_spheres(const SceneD& scene, std::span<const SphereSweepD> sweeps,
                          std::span<SceneSweepHitD> hits, const SceneOverlapOptions& options) {
    return sweep_batch<Near>(scene, sweeps, hits, options);
}
std::vector<SceneSweepHitD> sweep_spheres(const SceneD& scene, std::span<const SphereSweepD> sweeps,
                                          const SceneOverlapOptions& options) {
    std::vector<SceneSweepHitD> hits(sweeps.size());
    sweep_spheres(scene, sweeps, hits, options);
    return hits;
}
SceneSweepHitD sweep_sphere(const SceneD& scene, const SphereSweepD& sweep, std::uint32_t mask) {
    return sweep_single<Near, SceneSweepHitD>(scene, sweep, mask);
}

}  // namespace raydix
