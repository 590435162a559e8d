// What a commit makes of a scene in double, as scene_tree.h in float: wide trees over triangles,
// and one over those and the instances.
#pragma once

#include <raydix/double.h>
#include <raydix/scene.h>

#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <vector>

#include "engine/affine_double.h"
#include "engine/grouped_meshes.h"
#include "engine/mesh_name.h"
#include "engine/wide_tree_double.h"
#include "exec/path_rates.h"

namespace raydix {

struct MeshTreeD : GroupedMeshes {
    std::shared_ptr<const WideTreeD> tree;
};

struct SceneTreeD;
struct ShapeTreeD;  // shape_tree.h

/// The way into an instance.
struct WayInD {
    InverseD inverse;
    std::uint32_t mask;
};

/// A scene that rays enter by one instance, or by several in turn, as PlacedScene of floats.
struct PlacedSceneD {
    WayInD way;
    std::uint32_t number;       // of the path that ends here
    std::uint32_t first, more;  // further ways in SceneTreeD::ways, from the outside inward
    const SceneTreeD* scene;    // kept by SceneTreeD::instances, or by theirs
};

/// An instance as the scene's owner knows it.
struct InstanceNameD {
    std::uint32_t id, mask;
    std::uint32_t number;  // of the path that ends here
    TransformD transform;
    InverseD inverse;
    std::shared_ptr<const SceneTreeD> scene;
};

/// A wide tree over parts, one a leaf. The parts of a scene are numbered: mesh trees first, then
/// trees of shapes, then placed scenes.
struct PartTreeD : NodesD {
    std::vector<std::uint32_t> part;  // by the place that leaves name
    ExtentD around{nothing_d, 0.0};   // all of them
};

struct NearBodyD;  // near_body.h

/// What queries of distance made of a scene (near_body_of), by masks: the last ones.
struct KeptBodies {
    struct Body {
        std::uint32_t mask;
        std::once_flag made;  // unlike a mutex it is whole in a child that is forked off meanwhile
        std::shared_ptr<const NearBodyD> body = {};
        std::exception_ptr failed = {};
    };
    std::mutex asked;
    std::vector<std::shared_ptr<Body>> known;
};

struct SceneTreeD {
    std::vector<std::shared_ptr<const MeshTreeD>> meshes;
    std::vector<std::shared_ptr<const ShapeTreeD>> shapes;  // by ascending id
    std::vector<InstanceNameD> instances;                   // by ascending id
    std::vector<MeshNameD> mesh_names;                      // by ascending id
    std::vector<PlacedSceneD> placed;
    std::vector<ImageD> images;  // [placed scenes]
    std::vector<WayInD> ways;
    std::vector<ExtentD> extents;  // [parts]
    /// The meshes and shapes without the instances, where there are both.
    std::shared_ptr<const SceneTreeD> own_parts;
    PartTreeD parts;
    AabbD bounds = nothing_d;  // without what rays may miss it by
    Quality quality{};         // what it was made with
    Usage usage{};
    bool compact = false;  // as the commit had it; without effect
    std::uint64_t paths = 0;
    std::uint32_t levels = 0;    // of instances, below this scene
    std::size_t stack_size = 0;  // of a ray: children still to visit, on all levels
    mutable PathRates rates;     // of batches so far
    /// Of all geometries and instances, those of inner scenes too: ascending, each once.
    std::vector<std::uint32_t> masks;
    std::shared_ptr<KeptBodies> bodies = std::make_shared<KeptBodies>();

    /// The only mesh tree, if rays need nothing else.
    [[nodiscard]] const MeshTreeD* only_mesh() const {
        return instances.empty() && shapes.empty() && meshes.size() == 1 ? meshes.front().get()
                                                                         : nullptr;
    }
    /// Parts before the placed scenes.
    [[nodiscard]] std::size_t own_part_count() const { return meshes.size() + shapes.size(); }
};

}  // namespace raydix
