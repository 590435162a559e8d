// Rays through instances: down the group's tree, through the inverse of each instance that is met
// into its object's space, and on from there.
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/float_env.h"
#include "instances/instanced_scene.h"
#include "instances/ray_batch.h"
#include "trace/tree_hits.h"

namespace raydix {
namespace {

/// Nodes are entered up to here beyond the best hit: rounding on the way into an object's space
/// must not decide which of two hits is closer.
constexpr float reach_factor = 1.0f + 0x1p-16f;

using State = InstancedSceneAccess::State;
using Group = State::Group;

class InstanceWalk {
public:
    InstanceWalk(const State& state, std::uint32_t mask, bool any)
        : state_(state), mask_(mask), any_(any) {}

    /// `ray` must be valid.
    InstanceHit run(const Ray& ray) {
        const Double3 d(ray.direction);
        scale_ = direction_scale(std::max({std::fabs(d.x), std::fabs(d.y), std::fabs(d.z)}));
        tmin_ = in_line(ray.tmin);
        limit_ = in_line(ray.tmax);
        walk_group(state_.root(), {Double3(ray.origin), d * scale_}, 0);
        return best_.hit.hit() ? best_ : InstanceHit{};
    }

private:
    /// t of the line, whose direction is scaled: subnormal ones would be other directions inside.
    [[nodiscard]] float in_line(float t) const { return static_cast<float>(double(t) / scale_); }

    void walk_group(const Group& group, const WideRayLine& line, std::size_t level) {
        const Ray ray = line.rounded(tmin_, limit_);
        const Bvh& tree = group.tree.bvh;
        if (tree.empty() || !is_valid(ray)) return;
        WalkStack stack(tree.max_depth());
        const RayFrame frame = make_frame(ray);
        NoSteps steps;
        const auto leaf = [&](const BvhNode& node) {
            for (std::uint32_t k = node.first; k < node.first + node.count; ++k)
                if (enter(group, tree.order()[k], line, level)) return true;
            return false;
        };
        walk_tree(tree.nodes().data(), frame, stack, steps, leaf, [&] {
            return min_of(limit_ / frame.t_scale * reach_factor, std::numeric_limits<float>::max());
        });
    }

    /// Whether to stop.
    bool enter(const Group& group, std::uint32_t place, const WideRayLine& line,
               std::size_t level) {
        const Instance& instance = group.instances[place];
        if ((instance.mask & mask_) == 0) return false;
        path_[level] = place;
        const WideRayLine inside = line.into(group.inverses[place]);
        const State::Object& object = state_.object(instance.object);
        if (object.is_group)
            walk_group(state_.group(object), inside, level + 1);
        else
            hit_object(*object.mesh, instance.object, inside);
        path_[level] = no_primitive;
        return any_ && best_.hit.hit();
    }

    void hit_object(const Bvh& bvh, std::uint32_t object, const WideRayLine& line) {
        const Ray ray = line.rounded(tmin_, limit_);
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
        const auto t = static_cast<float>(found.t * frame.t_scale * scale_) + 0.0f;
        keep({{t, found.prim, found.u, found.v}, object, path_});
    }

    /// At equal t the lower path wins; within one instance find_closest has chosen. What differs in
    /// the line may be equal in the caller's units where those are subnormal: it must be found too.
    void keep(const InstanceHit& found) {
        const bool nearer = !best_.hit.hit() || found.hit.t < best_.hit.t;
        if (!nearer && !(found.hit.t == best_.hit.t && found.path < best_.path)) return;
        best_ = found;
        const float t = found.hit.t;
        limit_ = in_line(t < std::numeric_limits<float>::min() ? std::nextafter(t, infinity) : t);
    }

    const State& state_;
    std::uint32_t mask_;
    bool any_;
    double scale_ = 1.0;
    float tmin_ = 0.0f, limit_ = infinity;  // of the line
    InstanceHit best_;
    std::array<std::uint32_t, InstanceHit::max_levels> path_ = InstanceHit::unused();
};

const State& built_state(const InstancedScene& scene) {
    const State& state = InstancedSceneAccess::state(scene);
    state.require_built();
    return state;
}

/// Calls one(i, hit) for each ray.
template <class One>
InstanceTraceCounts for_each_ray(const InstancedScene& scene, std::span<const Ray> rays, bool any,
                                 const InstanceTraceOptions& options, const One& one) {
    const State& state = built_state(scene);
    const auto find = [&](const Ray& ray, std::uint32_t mask) {
        return InstanceWalk(state, mask, any).run(ray);
    };
    return instance_batch<InstanceHit>(rays, options, find, one);
}

}  // namespace

InstanceTraceCounts trace(const InstancedScene& scene, std::span<const Ray> rays,
                          std::span<InstanceHit> hits, const InstanceTraceOptions& options) {
    require_instance_room(rays.size(), hits.size());
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
    require_instance_room(rays.size(), occluded.size());
    return for_each_ray(scene, rays, true, options, [&](std::size_t i, const InstanceHit& hit) {
        occluded[i] = hit.hit.hit();
    });
}

InstanceHit closest_hit(const InstancedScene& scene, const Ray& ray, std::uint32_t mask) {
    const State& state = built_state(scene);
    const FloatEnvironment plain;
    if (!is_valid(ray)) return {};
    return InstanceWalk(state, mask, false).run(ray);
}

}  // namespace raydix
