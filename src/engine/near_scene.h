// What queries of distance and overlap need of a scene besides what rays do: the triangles without
// area, in a tree that rays never enter, and the maps of placed scenes from their space outward.
// Made when the first such query comes, and changed as SceneTree is (moved_instances.h).
#pragma once

#include <raydix/buffer.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "engine/affine.h"
#include "engine/scene_tree.h"
#include "engine/shape_tree.h"

namespace raydix {

/// A tree over triangles without area. Leaves name them as those of a WideBvh do.
struct FlatTriangles : PartTree {
    Buffer<TriangleBlock> blocks;  // by the mesh tree's numbers of triangles
};

/// `names`: of the scene that the tree belongs to. Null: there are none.
[[nodiscard]] const FlatTriangles* flat_triangles_of(const MeshTree& mesh,
                                                     const std::vector<MeshName>& names);

/// From the space of what is placed to that of the scene in which it stands.
struct NearWay {
    Affine map, inverse;  // products of all instances on the way
    /// For v in the inner space, the square of |map v| is at least the sum of weight[k] v[k]^2.
    float weight[3];
    double size;                 // at least the largest coordinate of the image, on all levels
    std::uint32_t first, count;  // of the instances' maps in NearScene::maps
    bool mirrors = false;        // all maps together
};

/// What of weight and size follows from map, and from the largest coordinate in the inner space.
void set_weights(NearWay& way);

/// One map farther out.
[[nodiscard]] NearWay compose(const NearWay& outer, const NearWay& inner);

/// Of what is placed by one instance more, whose map is `map`.
[[nodiscard]] NearWay placed_by(const Affine& map, const NearWay& inner);
/// Before the first: of a scene with coordinates up to `reach`.
[[nodiscard]] NearWay way_within(double reach, std::uint32_t first, std::uint32_t count);

struct NearScene {
    std::vector<NearWay> ways;  // [placed scenes]
    std::vector<Affine> maps;   // as the caller gave them, the innermost of each way first
    PartTree flats;             // over parts that hold triangles without area
    double reach = 0;           // the largest coordinate of all that is in the scene
    bool has_shapes = false, has_user_geometry = false;  // on any path
    /// The call and mask that were last found to have all answers, in one number.
    mutable std::atomic<std::uint64_t> has_answers = 0;

    [[nodiscard]] bool has_flats() const { return !flats.empty(); }
};

[[nodiscard]] const NearScene& near_scene_of(const SceneTree& scene);

}  // namespace raydix
