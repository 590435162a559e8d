// Distance and overlap on scenes in float, through the trees that rays take.
#include "engine/near_queries.h"

#include <raydix/error.h>
#include <raydix/scene_queries.h>

#include <cmath>
#include <string>
#include <string_view>
#include <unordered_set>
#include <utility>
#include <vector>

#include "engine/near_job.h"
#include "engine/near_scene.h"
#include "engine/scene_state.h"
#include "exec/thread_own.h"

namespace raydix {
namespace {

/// Throws InputError for the first geometry, by path, that the mask shows and that has no answer.
/// `path`: the one that leads to the tree. Each scene is looked at once, on however many paths it
/// stands.
void require_all_answers(const SceneTree& tree, std::uint32_t path, std::uint32_t mask,
                         NearCall call, std::unordered_set<const SceneTree*>& seen) {
    for (const auto& shapes : tree.shapes)
        if ((shapes->mask & mask) != 0 && !shapes->empty()) require_answers(*shapes, path, call);
    for (const InstanceName& instance : tree.instances)
        if ((instance.mask & mask) != 0 && seen.insert(instance.scene.get()).second)
            require_all_answers(*instance.scene, path + instance.number, mask, call, seen);
}

/// Throws InputError for geometry that has no answer.
const SceneTree& tree_for(const Scene& scene, std::uint32_t mask, NearCall call) {
    const SceneTree& tree = *SceneInternals::tree(scene);
    const NearScene& near = near_scene_of(tree);
    if (!(call == NearCall::sweep ? near.has_shapes : near.has_user_geometry)) return tree;
    const std::uint64_t asked = (static_cast<std::uint64_t>(call) + 1) << 32 | mask;
    if (near.has_answers.load(std::memory_order_relaxed) == asked) return tree;
    std::unordered_set<const SceneTree*> seen;
    require_all_answers(tree, 0, mask, call, seen);
    near.has_answers.store(asked, std::memory_order_relaxed);
    return tree;
}

/// Around all that a scene holds; lo > hi if that is nothing.
Aabb bounds_of(const SceneTree& tree) {
    const NearScene& near = near_scene_of(tree);
    return near.has_flats() ? unite(tree.bounds, near.flats.arrays.bounds) : tree.bounds;
}

SceneClosestPoint public_point(const NearBest& best) {
    if (!best.found()) return {};
    return {best.position, std::sqrt(best.d2), best.prim, best.geometry, best.instance, best.u,
            best.v};
}

SceneSweepHit hit_in_world(const NearContact& contact, const SphereSweep& sweep) {
    if (sweep.radius == 0.0f) {
        const float t = contact.t * make_frame(sweep.path).t_scale + 0.0f;  // -0 becomes +0
        if (!(t < infinity)) return {};  // farther than numbers go
        const LeafTriangle& triangle = contact.triangle;
        const Double3 a(triangle.v0), b(triangle.v1), c(triangle.v2);
        const Double3 at = a + (b - a) * contact.u + (c - a) * contact.v;
        return {t,         contact.prim, contact.geometry, contact.instance, at.rounded(),
                contact.u, contact.v};
    }
    const Vec3 center = kept(path_of(sweep.path).at(contact.t).rounded());
    const TrianglePoint at = closest_on_triangle(contact.triangle, center);
    return {contact.t + 0.0f,
            contact.prim,
            contact.geometry,
            contact.instance,
            at.position,
            at.u,
            at.v};
}
SceneSweepHit public_hit(const NearContact& contact, const SphereSweep& sweep) {
    if (!contact.found()) return {};
    SceneSweepHit hit = hit_in_world(contact, sweep);
    if (contact.turned) std::swap(hit.u, hit.v);
    return hit;
}

/// The best kernels are known after the first call.
const NearKernels& kernels_of(std::string_view isa) {
    static const NearKernels& best = near_kernels_for({});
    return isa.empty() ? best : near_kernels_for(isa);
}

/// As near_queries.h has it.
class Near {
public:
    Near(const Scene& scene, std::uint32_t mask, NearCall call, std::string_view isa = {},
         ResultBudget* = nullptr)
        : tree_(tree_for(scene, mask, call)), mask_(mask), kernels_(kernels_of(isa)) {}

    [[nodiscard]] Buffer<std::uint32_t> order(std::span<const Vec3> places) const {
        const Aabb bounds = bounds_of(tree_);
        return is_empty(bounds) ? Buffer<std::uint32_t>() : order_by_place(bounds, places);
    }

    class Thread {
    public:
        explicit Thread(const Near& near) : kernels_(near.kernels_) {
            job_->tree = &near.tree_;
            job_->mask = near.mask_;
            job_->guess.view = nullptr;
        }

        SceneClosestPoint closest(Vec3 query, float limit) {
            return public_point(kernels_.closest(*job_, query, limit));
        }
        bool touch(const Segment& segment, BudgetVector<ScenePrimitive>* found) {
            return kernels_.touch_segment(*job_, segment, found);
        }
        bool touch(const Sphere& sphere, BudgetVector<ScenePrimitive>* found) {
            return kernels_.touch_sphere(*job_, sphere, found);
        }
        SceneSweepHit sweep(const SphereSweep& sweep) {
            return public_hit(kernels_.sweep(*job_, sweep), sweep);
        }

    private:
        const NearKernels& kernels_;
        ThreadOwn<NearJob> job_;
    };

private:
    const SceneTree& tree_;
    const std::uint32_t mask_;
    const NearKernels& kernels_;
};

/// In a plain environment. Not inlined: of two copies in one function a compiler makes one, before
/// the environment is set.
[[gnu::noinline]] SceneClosestPoint closest_plainly(const Scene& scene, Vec3 query,
                                                    float max_distance, std::uint32_t mask) {
    const float limit = square_limit_of(max_distance);
    const Near near(scene, mask, NearCall::closest);
    if (!is_finite(query)) return {};
    return Near::Thread(near).closest(query, limit);
}

}  // namespace

QueryCounts closest_points(const Scene& scene, std::span<const Vec3> queries,
                           std::span<SceneClosestPoint> results,
                           const SceneClosestOptions& options) {
    return closest_batch<Near>(scene, queries, results, options);
}
std::vector<SceneClosestPoint> closest_points(const Scene& scene, std::span<const Vec3> queries,
                                              const SceneClosestOptions& options) {
    std::vector<SceneClosestPoint> results(queries.size());
    closest_points(scene, queries, results, options);
    return results;
}
SceneClosestPoint closest_point(const Scene& scene, Vec3 query, float max_distance,
                                std::uint32_t mask) {
    if (FloatEnvironment::is_plain()) return closest_plainly(scene, query, max_distance, mask);
    const FloatEnvironment plain;
    return closest_plainly(scene, query, max_distance, mask);
}

QueryCounts touch_any(const Scene& scene, std::span<const Segment> queries,
                      std::span<std::uint8_t> touched, const SceneOverlapOptions& options) {
    return touch_any_batch<Near>(scene, queries, touched, options);
}
QueryCounts touch_any(const Scene& scene, std::span<const Sphere> queries,
                      std::span<std::uint8_t> touched, const SceneOverlapOptions& options) {
    return touch_any_batch<Near>(scene, queries, touched, options);
}
bool touches(const Scene& scene, const Segment& segment, std::uint32_t mask) {
    return touches_one<Near>(scene, segment, mask);
}
bool touches(const Scene& scene, const Sphere& sphere, std::uint32_t mask) {
    return touches_one<Near>(scene, sphere, mask);
}

SceneOverlapLists touch_all(const Scene& scene, std::span<const Segment> queries,
                            const SceneOverlapOptions& options) {
    return touch_all_batch<Near>(scene, queries, options);
}
SceneOverlapLists touch_all(const Scene& scene, std::span<const Sphere> queries,
                            const SceneOverlapOptions& options) {
    return touch_all_batch<Near>(scene, queries, options);
}

QueryCounts sweep_spheres(const Scene& scene, std::span<const SphereSweep> sweeps,
                          std::span<SceneSweepHit> hits, const SceneOverlapOptions& options) {
    return sweep_batch<Near>(scene, sweeps, hits, options);
}
std::vector<SceneSweepHit> sweep_spheres(const Scene& scene, std::span<const SphereSweep> sweeps,
                                         const SceneOverlapOptions& options) {
    std::vector<SceneSweepHit> hits(sweeps.size());
    sweep_spheres(scene, sweeps, hits, options);
    return hits;
}
SceneSweepHit sweep_sphere(const Scene& scene, const SphereSweep& sweep, std::uint32_t mask) {
    return sweep_single<Near, SceneSweepHit>(scene, sweep, mask);
}

}  // namespace raydix
