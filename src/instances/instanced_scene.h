// What an InstancedScene holds.
#pragma once

#include <raydix/instances.h>

#include <optional>
#include <vector>

#include "instances/affine.h"
#include "instances/scene_groups.h"

namespace raydix {

struct FloatInstances {
    using Instance = raydix::Instance;
    using Mesh = const Bvh*;
    using Inverse = Affine;
    using Extent = Aabb;
    struct Tree {
        std::vector<Aabb> extents;
        Bvh bvh;
    };

    static std::optional<Affine> inverse_of(const Instance& instance) {
        return raydix::inverse_of(affine_of(instance.transform));
    }
    static Aabb extent_of(const Bvh* bvh) { return bvh->bounds(); }
    static Aabb extent_of(const Tree& tree) { return tree.bvh.bounds(); }
    static Aabb image(const Instance& instance, const Affine&, const Aabb& box) {
        return image_of(affine_of(instance.transform), box);
    }
    static bool is_empty(const Aabb& box) { return box.lo.x > box.hi.x; }
    static bool in_range(const Aabb& box) {
        return raydix::in_range(box.lo) && raydix::in_range(box.hi);
    }
    static void build(BvhBuilder& builder, Tree& tree) {
        builder.build(tree.extents, {.builder = Builder::apetrei, .max_leaf = 1}, tree.bvh);
    }
};

struct InstancedScene::State : SceneGroups<FloatInstances> {};

struct InstancedSceneAccess {
    using State = InstancedScene::State;
    static const State& state(const InstancedScene& scene) { return *scene.state_; }
};

}  // namespace raydix
