// What a commit makes of a scene in double, as scene_tree.h in float: trees over triangles with two
// children a node, and one over those and the instances.
#pragma once

#include <raydix/double.h>
#include <raydix/scene.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "engine/grouped_meshes.h"
#include "engine/mesh_name.h"
#include "instances/affine_double.h"
#include "instances/instance_tree_double.h"

namespace raydix {

struct MeshTreeD : GroupedMeshes {
    std::shared_ptr<const BvhD> tree;
};

struct SceneTreeD;

/// A scene that rays enter by an instance.
struct PlacedSceneD {
    std::uint32_t id;
    std::uint32_t number;  // of the path that ends here
    std::uint32_t mask;
    InverseD inverse;
    TransformD transform;
    std::shared_ptr<const SceneTreeD> scene;
};

struct SceneTreeD {
    std::vector<std::shared_ptr<const MeshTreeD>> meshes;
    std::vector<PlacedSceneD> instances;  // by ascending id
    std::vector<MeshNameD> mesh_names;    // by ascending id
    InstanceTreeD parts;                  // mesh trees first, then instances
    AabbD bounds = nothing_d;             // without what rays may miss it by
    Quality quality{};                    // what it was made with
    bool compact = false;                 // as the commit had it; without effect
    std::uint64_t paths = 0;
    std::uint32_t levels = 0;  // of instances, below this scene

    /// The only mesh tree, if rays need nothing else.
    [[nodiscard]] const MeshTreeD* only_mesh() const {
        return instances.empty() && meshes.size() == 1 ? meshes.front().get() : nullptr;
    }
};

}  // namespace raydix
