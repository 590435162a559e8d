// Rays in double through scenes, one after the other: down the tree over the parts with room for
// what rounding on the way into instances may move, through the inverse of each instance that is
// met, and on from there.
#include <raydix/error.h>
#include <raydix/scene.h>

#include <cmath>
#include <limits>
#include <vector>

#include "base/float_env.h"
#include "base/options.h"
#include "engine/hit_order.h"
#include "engine/scene_batch.h"
#include "engine/scene_state.h"
#include "exec/parallel.h"
#include "trace/all_hits.h"
#include "trace/batch.h"
#include "trace/simd/wide_batch.h"
#include "trace/tree_hits.h"

namespace raydix {
namespace {

constexpr std::size_t block_size = 512;

enum class Wanted { closest, any, all };

template <Wanted wanted>
class SceneRayD {
public:
    /// The ray must be valid. `found`: of all hits.
    SceneRayD(const SceneTreeD& scene, const RayD& ray, std::uint32_t mask,
              BudgetVector<HitD>* found = nullptr)
        : mask_(mask), tmin_(ray.tmin), reach_(ray.tmax), found_(found) {
        walk(scene, 0, LineD(ray));
    }

    [[nodiscard]] const HitD& best() const { return best_; }

private:
    /// Whether to stop; so do all below.
    bool walk(const SceneTreeD& scene, std::uint32_t number, const LineD& line) {
        if (const MeshTreeD* const mesh = scene.only_mesh()) return hit_mesh(*mesh, number, line);
        const InstanceTreeD& parts = scene.parts;
        const RayD ray = line.ray(tmin_, reach_);
        if (parts.bvh.empty() || !is_valid(ray)) return false;
        WalkStackD stack(parts.bvh.max_depth());
        const RayFrameD frame = make_frame(ray);
        const InstanceNodesD nodes(parts, ray, frame);
        bool stop = false;
        const auto leaf = [&](const BvhNode& node) {
            for (std::uint32_t k = node.first; k < node.first + node.count && !stop; ++k)
                stop = visit(scene, parts.bvh.order()[k], number, line);
            return stop;
        };
        walk_entered(
            parts.bvh.nodes().data(), stack, [&](const BvhNode& node) { return nodes.enter(node); },
            leaf, [&] { return reach_ / frame.t_scale; });
        return stop;
    }

    bool visit(const SceneTreeD& scene, std::uint32_t part, std::uint32_t number,
               const LineD& line) {
        if (part < scene.meshes.size()) return hit_mesh(*scene.meshes[part], number, line);
        const PlacedSceneD& placed = scene.instances[part - scene.meshes.size()];
        return (placed.mask & mask_) != 0 &&
               walk(*placed.scene, number + placed.number, line.into(placed.inverse));
    }

    bool hit_mesh(const MeshTreeD& mesh, std::uint32_t number, const LineD& line) {
        if (mesh.tree->empty() || (mesh.mask & mask_) == 0) return false;
        const RayD ray = line.ray(tmin_, reach_);
        if (!is_valid(ray)) return false;
        const TriangleTreeD tree(*mesh.tree);
        WalkStackD stack(tree.max_depth);
        const RayFrameD frame = make_frame(ray);
        NoSteps steps;
        if constexpr (wanted == Wanted::any) {
            if (!find_any(tree, frame, stack, steps)) return false;
            best_.prim = 0;
            return true;
        } else if constexpr (wanted == Wanted::all) {
            find_all(tree, frame, stack, steps, [&](double t, std::uint32_t k, double u, double v) {
                found_->push_back(named({t + 0.0, tree.order[k], u, v}, mesh, number));
            });
        } else {
            const BasicClosestHit<double> hit = find_closest(tree, frame, stack, steps);
            if (hit.prim != no_primitive)
                keep(named({hit.t * frame.t_scale + 0.0, hit.prim, hit.u, hit.v}, mesh, number));
        }
        return false;
    }

    static HitD named(const TreeHitD& in_tree, const MeshTreeD& mesh, std::uint32_t number) {
        HitD hit{in_tree, no_primitive, number};
        mesh.name(hit);
        return hit;
    }

    void keep(const HitD& hit) {
        if (best_.hit() && !(order_of(hit) < order_of(best_))) return;
        best_ = hit;
        // What differs on the way in may be equal in the caller's units where those are subnormal:
        // it must be found too.
        reach_ = hit.t < std::numeric_limits<double>::min() ? std::nextafter(hit.t, 1.0) : hit.t;
    }

    const std::uint32_t mask_;
    const double tmin_;
    double reach_;
    HitD best_;
    BudgetVector<HitD>* found_;
};

const SceneTreeD& checked_tree(const SceneD& scene, std::size_t rays,
                               const SceneTraceOptions& options) {
    const SceneTreeD& tree = *SceneAccessD::tree(scene);
    check_enum("path", options.path, SimdPath::sorted);
    check_masks(rays, options);
    static_cast<void>(kernels_for(options.isa));
    return tree;
}

/// Calls one(block, i, mask) -> number of hits for each valid ray and miss(i) for each other one;
/// done(b) after those of block b.
template <class One, class Miss, class Done>
TraceCounts for_each_ray(std::span<const RayD> rays, const SceneTraceOptions& options,
                         const One& one, const Miss& miss, const Done& done) {
    std::vector<JobCounts> parts((rays.size() + block_size - 1) / block_size);
    for_each_block(
        rays.size(), block_size, [&](std::size_t block, std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                if (!is_valid(rays[i])) {
                    ++parts[block].invalid;
                    miss(i);
                } else {
                    parts[block].hits +=
                        one(block, i, options.masks.empty() ? options.mask : options.masks[i]);
                }
            }
            done(block);
        });
    return sum_of(parts, rays.size());
}

}  // namespace

TraceCounts trace(const SceneD& scene, std::span<const RayD> rays, std::span<HitD> hits,
                  const SceneTraceOptions& options) {
    check_sizes(rays.size(), hits.size());
    const SceneTreeD& tree = checked_tree(scene, rays.size(), options);
    TraceCounts counts;
    with_threads(options.threads, [&] {
        counts = for_each_ray(
            rays, options,
            [&](std::size_t, std::size_t i, std::uint32_t mask) {
                hits[i] = SceneRayD<Wanted::closest>(tree, rays[i], mask).best();
                return std::uint64_t{hits[i].hit()};
            },
            [&](std::size_t i) { hits[i] = {}; }, [](std::size_t) {});
    });
    return counts;
}

std::vector<HitD> trace(const SceneD& scene, std::span<const RayD> rays,
                        const SceneTraceOptions& options) {
    std::vector<HitD> hits(rays.size());
    trace(scene, rays, hits, options);
    return hits;
}

TraceCounts trace_any(const SceneD& scene, std::span<const RayD> rays,
                      std::span<std::uint8_t> occluded, const SceneTraceOptions& options) {
    check_sizes(rays.size(), occluded.size());
    const SceneTreeD& tree = checked_tree(scene, rays.size(), options);
    TraceCounts counts;
    with_threads(options.threads, [&] {
        counts = for_each_ray(
            rays, options,
            [&](std::size_t, std::size_t i, std::uint32_t mask) {
                occluded[i] = SceneRayD<Wanted::any>(tree, rays[i], mask).best().hit();
                return std::uint64_t{occluded[i]};
            },
            [&](std::size_t i) { occluded[i] = 0; }, [](std::size_t) {});
    });
    return counts;
}

AllHitsD trace_all(const SceneD& scene, std::span<const RayD> rays,
                   const SceneTraceOptions& options) {
    const SceneTreeD& tree = checked_tree(scene, rays.size(), options);
    HitBlocks<AllHitsD> found(rays.size(), block_size, options.max_result_bytes);
    AllHitsD all;
    TraceCounts counts;
    with_threads(options.threads, [&] {
        counts = for_each_ray(
            rays, options,
            [&](std::size_t block, std::size_t i, std::uint32_t mask) {
                BudgetVector<HitD>& hits = found.hits(block);
                const std::size_t before = hits.size();
                const SceneRayD<Wanted::all> ray(tree, rays[i], mask, &hits);
                finish_scene_ray(hits, before);
                return found.hit_counts()[i] = hits.size() - before;
            },
            [](std::size_t) {}, [&](std::size_t block) { found.finish(block); });
        all = found.join();
    });
    all.counts = counts;
    return all;
}

HitD closest_hit(const SceneD& scene, const RayD& ray, std::uint32_t mask) {
    const SceneTreeD& tree = *SceneAccessD::tree(scene);
    const FloatEnvironment plain;
    if (!is_valid(ray)) return {};
    return SceneRayD<Wanted::closest>(tree, ray, mask).best();
}

bool any_hit(const SceneD& scene, const RayD& ray, std::uint32_t mask) {
    const SceneTreeD& tree = *SceneAccessD::tree(scene);
    const FloatEnvironment plain;
    if (!is_valid(ray)) return false;
    return SceneRayD<Wanted::any>(tree, ray, mask).best().hit();
}

}  // namespace raydix
