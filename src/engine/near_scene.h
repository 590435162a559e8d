// What queries of distance and overlap need of a scene besides what rays do: the triangles without
// area, in a tree that rays never enter, and the maps of placed scenes from their space outward.
// Made when the first such query comes, and never changed.
#pragma once

#include <raydix/buffer.h>

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

/// A geometry that is not made of triangles, and the masks that a query must see to come to it.
struct ShownShapes {
    std::vector<std::uint32_t> masks;
    const ShapeTree* shapes;

    [[nodiscard]] bool seen_by(std::uint32_t mask) const {
        for (const std::uint32_t m : masks)
            if ((m & mask) == 0) return false;
        return true;
    }
    /// An order by addresses, for sets.
    friend auto operator<=>(const ShownShapes&, const ShownShapes&) = default;
};

struct NearScene {
    std::vector<NearWay> ways;        // [placed scenes]
    std::vector<Affine> maps;         // as the caller gave them, the innermost of each way first
    PartTree flats;                   // over parts that hold triangles without area
    double reach = 0;                 // the largest coordinate of all that is in the scene
    std::vector<ShownShapes> shapes;  // each once, by the least (path, geometry) of it

    [[nodiscard]] bool has_flats() const { return !flats.empty(); }
};

[[nodiscard]] const NearScene& near_scene_of(const SceneTree& scene);

}  // namespace raydix
