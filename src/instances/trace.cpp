// Rays through instances: down the group's tree, through the inverse of each instance that is met
// into its object's space, and on from there.
#include <raydix/error.h>

#include <string>

#include "base/float_env.h"
#include "exec/parallel.h"
#include "instances/instanced_scene.h"
#include "trace/tree_hits.h"

namespace raydix {
namespace {

constexpr std::size_t rays_per_block = 512;
/// Nodes are entered up to here beyond the best hit: rounding on the way into an object's space
/// must not decide which of two hits is closer.
constexpr float reach_factor = 1.0f + 0x1p-16f;

using State = InstancedSceneAccess::State;

class InstanceWalk {
public:
    InstanceWalk(const State& state, std::uint32_t mask, bool any)
        : state_(state), mask_(mask), any_(any) {}

    /// `ray` must be valid.
    InstanceHit run(const Ray& ray) {
        tmin_ = ray.tmin;
        best_.hit.t = ray.tmax;
        walk_group(state_.groups[0], {Double3(ray.origin), Double3(ray.direction)}, 0);
        return best_.hit.hit() ? best_ : InstanceHit{};
    }

private:
    void walk_group(const InstanceGroup& group, const WideRayLine& line, std::size_t level) {
        const Ray ray = line.rounded(tmin_, best_.hit.t);
        if (group.tree.empty() || !is_valid(ray)) return;
        WalkStack stack(group.tree.max_depth());
        const RayFrame frame = make_frame(ray);
        NoSteps steps;
        const auto leaf = [&](const BvhNode& node) {
            for (std::uint32_t k = node.first; k < node.first + node.count; ++k)
                if (enter(group, group.tree.order()[k], line, level)) return true;
            return false;
        };
        walk_tree(group.tree.nodes().data(), frame, stack, steps, leaf, [&] {
            return min_of(best_.hit.t / frame.t_scale * reach_factor,
                          std::numeric_limits<float>::max());
        });
    }

    /// Whether to stop.
    bool enter(const InstanceGroup& group, std::uint32_t place, const WideRayLine& line,
               std::size_t level) {
        const Instance& instance = group.instances[place];
        if ((instance.mask & mask_) == 0) return false;
        path_[level] = place;
        const WideRayLine inside = line.into(group.inverses[place]);
        const SceneObject& object = state_.objects[instance.object];
        if (object.bvh == nullptr)
            walk_group(state_.groups[object.group], inside, level + 1);
        else
            hit_object(*object.bvh, instance.object, inside);
        path_[level] = no_primitive;
        return any_ && best_.hit.hit();
    }

    void hit_object(const Bvh& bvh, std::uint32_t object, const WideRayLine& line) {
        const Ray ray = line.rounded(tmin_, best_.hit.t);
        if (bvh.empty() || !is_valid(ray)) return;
        WalkStack stack(bvh.max_depth());
        const TriangleTree tree(bvh);
        const RayFrame frame = make_frame(ray);
        NoSteps steps;
        if (any_) {
            if (find_any(tree, frame, stack, steps)) best_ = {{0.0f, 0}, object, path_};
            return;
        }
        const ClosestHit found = find_closest(tree, frame, stack, steps);
        if (found.prim == no_primitive) return;
        const Hit hit{found.t * frame.t_scale, found.prim, found.u, found.v};
        // At equal t the lower path wins; within one instance find_closest has chosen.
        if (hit.t < best_.hit.t || !best_.hit.hit() || path_ < best_.path)
            best_ = {hit, object, path_};
    }

    const State& state_;
    std::uint32_t mask_;
    bool any_;
    float tmin_ = 0.0f;
    InstanceHit best_;
    std::array<std::uint32_t, InstanceHit::max_levels> path_ = InstanceHit::unused();
};

const State& built_state(const InstancedScene& scene) {
    const State& state = InstancedSceneAccess::state(scene);
    if (!state.built) throw InputError("scene of instances: call build after the last change");
    return state;
}

/// Calls one(i, hit) for each ray.
template <class One>
InstanceTraceCounts for_each_ray(const InstancedScene& scene, std::span<const Ray> rays, bool any,
                                 const InstanceTraceOptions& options, const One& one) {
    const State& state = built_state(scene);
    if (!options.masks.empty() && options.masks.size() != rays.size())
        throw InputError("trace: " + std::to_string(rays.size()) + " rays, but " +
                         std::to_string(options.masks.size()) + " masks");
    std::vector<InstanceTraceCounts> parts((rays.size() + rays_per_block - 1) / rays_per_block);
    with_threads(options.threads, [&] {
        for_each_block(
            rays.size(), rays_per_block,
            [&](std::size_t block, std::size_t begin, std::size_t end) {
                for (std::size_t i = begin; i < end; ++i) {
                    InstanceHit hit;
                    if (!is_valid(rays[i]))
                        ++parts[block].invalid_rays;
                    else
                        hit =
                            InstanceWalk(
                                state, options.masks.empty() ? options.mask : options.masks[i], any)
                                .run(rays[i]);
                    parts[block].hits += hit.hit.hit();
                    one(i, hit);
                }
            });
    });
    InstanceTraceCounts sum;
    sum.rays = rays.size();
    for (const InstanceTraceCounts& part : parts) {
        sum.hits += part.hits;
        sum.invalid_rays += part.invalid_rays;
    }
    return sum;
}

void require_room(std::size_t rays, std::size_t results) {
    if (rays != results)
        throw InputError("trace: " + std::to_string(rays) + " rays, but room for " +
                         std::to_string(results) + " results");
}

}  // namespace

InstanceTraceCounts trace(const InstancedScene& scene, std::span<const Ray> rays,
                          std::span<InstanceHit> hits, const InstanceTraceOptions& options) {
    require_room(rays.size(), hits.size());
    return for_each_ray(scene, rays, false, options,
                        [&](std::size_t i, const InstanceHit& hit) { hits[i] = hit; });
}

std::vector<InstanceHit> trace(const InstancedScene& scene, std::span<const Ray> rays,
                               const InstanceTraceOptions& options) {
    std::vector<InstanceHit> hits(rays.size());
    trace(scene, rays, hits, options);
    return hits;
}

InstanceTraceCounts trace_any(const InstancedScene& scene, std::span<const Ray> rays,
                              std::span<std::uint8_t> occluded,
                              const InstanceTraceOptions& options) {
    require_room(rays.size(), occluded.size());
    return for_each_ray(scene, rays, true, options, [&](std::size_t i, const InstanceHit& hit) {
        occluded[i] = hit.hit.hit();
    });
}

InstanceHit closest_hit(const InstancedScene& scene, const Ray& ray, std::uint32_t mask) {
    const State& state = built_state(scene);
    if (!is_valid(ray)) return {};
    const FloatEnvironment plain;
    return InstanceWalk(state, mask, false).run(ray);
}

}  // namespace raydix
