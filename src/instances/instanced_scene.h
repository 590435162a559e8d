// What an InstancedScene holds.
#pragma once

#include <raydix/instances.h>

#include <cstdint>
#include <vector>

#include "instances/affine.h"

namespace raydix {

struct InstanceGroup {
    std::vector<Instance> instances;
    std::vector<Affine> inverses;  // a row each
    std::vector<Aabb> boxes;       // of the last build
    Bvh tree;                      // over the boxes
};

/// A tree of triangles, or, if null, a group.
struct SceneObject {
    const Bvh* bvh;
    std::uint32_t group;
};

struct InstancedScene::State {
    std::vector<SceneObject> objects;
    std::vector<InstanceGroup> groups;
    BvhBuilder builder;
    bool built = false;
};

struct InstancedSceneAccess {
    using State = InstancedScene::State;
    static const State& state(const InstancedScene& scene) { return *scene.state_; }
};

}  // namespace raydix
