// What an InstancedSceneD holds.
#pragma once

#include <raydix/instances_d.h>

#include <optional>

#include "instances/affine_double.h"
#include "instances/instance_tree_double.h"
#include "instances/scene_groups.h"

namespace raydix {

/// One of them, or none.
struct SceneMeshD {
    const BvhD* bvh = nullptr;
    const Bvh* of_floats = nullptr;
};

struct DoubleInstances {
    using Instance = InstanceD;
    using Mesh = SceneMeshD;
    using Inverse = InverseD;
    using Extent = ExtentD;
    using Tree = InstanceTreeD;

    static std::optional<InverseD> inverse_of(const InstanceD& instance) {
        return raydix::inverse_of(affine_of(instance.transform));
    }
    static ExtentD extent_of(const SceneMeshD& mesh);
    static ExtentD extent_of(const Tree& tree) { return tree.around; }
    static ExtentD image(const InstanceD& instance, const InverseD& inverse,
                         const ExtentD& extent) {
        return image_of(affine_of(instance.transform), inverse, extent);
    }
    static bool is_empty(const ExtentD& extent) { return raydix::is_empty(extent); }
    static bool in_range(const ExtentD& extent) { return raydix::in_range(extent); }
    static void build(BvhBuilder& builder, Tree& tree) {
        tree.build(builder, {.builder = Builder::apetrei});
    }
};

struct InstancedSceneD::State : SceneGroups<DoubleInstances> {};

struct InstancedSceneDAccess {
    using State = InstancedSceneD::State;
    static const State& state(const InstancedSceneD& scene) { return *scene.state_; }
};

}  // namespace raydix
