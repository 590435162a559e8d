// Rays in double through instances: down the group's float nodes with room for what rounding on the
// way into objects may move, through the inverse of each instance that is met, and on from there.
#include <raydix/instances_d.h>

#include "base/float_env.h"
#include "instances/double_scene.h"
#include "instances/instance_tree_double.h"
#include "instances/ray_batch.h"
#include "trace/grown_boxes.h"
#include "trace/tree_hits.h"

namespace raydix {
namespace {

using State = InstancedSceneDAccess::State;
using Group = State::Group;

/// A float tree whose corners are read in double: its nodes hold them as they are.
struct WidenedTree {
    using Scalar = double;
    using Corners = LeafTriangleD;
    struct Triangles {
        const LeafTriangle* corners;

        [[nodiscard]] LeafTriangleD operator[](std::size_t k) const {
            const auto wide = [](Vec3 p) { return Vec3d{p.x, p.y, p.z}; };
            return {wide(corners[k].v0), wide(corners[k].v1), wide(corners[k].v2)};
        }
    };

    const BvhNode* nodes;
    Triangles triangles;
    const std::uint32_t* order;
    std::uint32_t max_depth;
    bool empty;

    explicit WidenedTree(const Bvh& bvh)
        : nodes(bvh.nodes().data()),
          triangles{bvh.triangles().data()},
          order(bvh.order().data()),
          max_depth(bvh.max_depth()),
          empty(bvh.empty()) {}

    [[nodiscard]] const RayFrameD& local(const RayFrameD& ray) const { return ray; }
};

class InstanceWalkD {
public:
    InstanceWalkD(const State& state, std::uint32_t mask, bool any)
        : state_(state), mask_(mask), any_(any) {}

    /// `ray` must be valid.
    InstanceHitD run(const RayD& ray) {
        tmin_ = ray.tmin;
        best_.hit.t = ray.tmax;
        walk_group(state_.root(), LineD(ray), 0);
        return best_.hit.hit() ? best_ : InstanceHitD{};
    }

private:
    void walk_group(const Group& group, const LineD& line, std::size_t level) {
        const Bvh& tree = group.tree.bvh;
        const RayD ray = line.ray(tmin_, best_.hit.t);
        if (tree.empty() || !is_valid(ray)) return;
        WalkStackD stack(tree.max_depth());
        const RayFrameD frame = make_frame(ray);
        const InstanceNodesD nodes(group.tree, ray, frame);
        const auto leaf = [&](const BvhNode& node) {
            for (std::uint32_t k = node.first; k < node.first + node.count; ++k)
                if (enter(group, tree.order()[k], line, level)) return true;
            return false;
        };
        walk_entered(
            tree.nodes().data(), stack, [&](const BvhNode& node) { return nodes.enter(node); },
            leaf, [&] { return best_.hit.t / frame.t_scale; });
    }

    /// Whether to stop.
    bool enter(const Group& group, std::uint32_t place, const LineD& line, std::size_t level) {
        const InstanceD& instance = group.instances[place];
        if ((instance.mask & mask_) == 0) return false;
        path_[level] = place;
        const LineD inside = line.into(group.inverses[place]);
        const State::Object& object = state_.object(instance.object);
        if (object.is_group)
            walk_group(state_.group(object), inside, level + 1);
        else if (object.mesh.bvh != nullptr)
            hit_object(TriangleTreeD(*object.mesh.bvh), instance.object, inside);
        else
            hit_object(WidenedTree(*object.mesh.of_floats), instance.object, inside);
        path_[level] = no_primitive;
        return any_ && best_.hit.hit();
    }

    template <class Tree>
    void hit_object(const Tree& tree, std::uint32_t object, const LineD& line) {
        const RayD ray = line.ray(tmin_, best_.hit.t);
        if (tree.empty || !is_valid(ray)) return;
        WalkStackD stack(tree.max_depth);
        const RayFrameD frame = make_frame(ray);
        NoSteps steps;
        if (any_) {
            if (find_any(tree, frame, stack, steps)) best_ = {{0.0, 0}, object, path_};
            return;
        }
        const BasicClosestHit<double> found = find_closest(tree, frame, stack, steps);
        if (found.prim == no_primitive) return;
        const TreeHitD hit{found.t * frame.t_scale + 0.0, found.prim, found.u, found.v};
        // At equal t the lower path wins; within one instance find_closest has chosen.
        if (hit.t < best_.hit.t || !best_.hit.hit() || path_ < best_.path)
            best_ = {hit, object, path_};
    }

    const State& state_;
    std::uint32_t mask_;
    bool any_;
    double tmin_ = 0.0;
    InstanceHitD best_;
    std::array<std::uint32_t, InstanceHitD::max_levels> path_ = InstanceHit::unused();
};

const State& built_state(const InstancedSceneD& scene) {
    const State& state = InstancedSceneDAccess::state(scene);
    state.require_built();
    return state;
}

/// Calls one(i, hit) for each ray.
template <class One>
InstanceTraceCounts for_each_ray(const InstancedSceneD& scene, std::span<const RayD> rays, bool any,
                                 const InstanceTraceOptions& options, const One& one) {
    const State& state = built_state(scene);
    const auto find = [&](const RayD& ray, std::uint32_t mask) {
        return InstanceWalkD(state, mask, any).run(ray);
    };
    return instance_batch<InstanceHitD>(rays, options, find, one);
}

}  // namespace

InstanceTraceCounts trace(const InstancedSceneD& scene, std::span<const RayD> rays,
                          std::span<InstanceHitD> hits, const InstanceTraceOptions& options) {
    require_instance_room(rays.size(), hits.size());
    return for_each_ray(scene, rays, false, options,
                        [&](std::size_t i, const InstanceHitD& hit) { hits[i] = hit; });
}

std::vector<InstanceHitD> trace(const InstancedSceneD& scene, std::span<const RayD> rays,
                                const InstanceTraceOptions& options) {
    std::vector<InstanceHitD> hits(rays.size());
    trace(scene, rays, hits, options);
    return hits;
}

InstanceTraceCounts trace_any(const InstancedSceneD& scene, std::span<const RayD> rays,
                              std::span<std::uint8_t> occluded,
                              const InstanceTraceOptions& options) {
    require_instance_room(rays.size(), occluded.size());
    return for_each_ray(scene, rays, true, options, [&](std::size_t i, const InstanceHitD& hit) {
        occluded[i] = hit.hit.hit();
    });
}

InstanceHitD closest_hit(const InstancedSceneD& scene, const RayD& ray, std::uint32_t mask) {
    const State& state = built_state(scene);
    const FloatEnvironment plain;
    if (!is_valid(ray)) return {};
    return InstanceWalkD(state, mask, false).run(ray);
}

}  // namespace raydix
