// Queries of distance and overlap on a scene: what they are asked, what they answer, and the doors
// to the kernels that are compiled once per instruction set (near_kernels.cpp).
#pragma once

#include <raydix/scene_queries.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string_view>
#include <tuple>
#include <vector>

#include "engine/near_scene.h"
#include "engine/scene_tree.h"
#include "exec/result_budget.h"

namespace raydix {

/// Nodes and leaves that are still to visit, on all levels: words as in WideNode::child.
struct NearStack {
    struct Entry {
        float key;  // nothing in it counts before
        std::uint32_t word;
    };
    std::vector<Entry> entries;
    std::size_t top = 0;

    /// Room for the children of one more node.
    void make_room() {
        if (top + quantised_width > entries.size()) entries.resize(2 * top + 256);
    }
};

/// Where a walk is below the outermost scene: what is placed, and in what.
struct NearSpace {
    const NearSpace* outer;  // null: the outermost scene
    const NearWay* way;      // from here to the outermost scene
    const Affine* maps;      // [count] to the outer space, the innermost first
    std::uint32_t count;
};

/// A leaf of a tree over triangles, for the next query.
struct NearGuess {
    const WideView* view = nullptr;  // null: none
    const MeshTree* mesh = nullptr;
    std::uint32_t number = 0;  // of the path of instances
    std::uint32_t word = 0;
    bool placed = false;
    NearSpace space{};
};

/// The best so far; at equal d2 the least (instance, geometry, prim).
struct NearBest {
    float d2;
    std::uint32_t instance = no_primitive, geometry = no_primitive, prim = no_primitive;
    Vec3 position{};
    float u = 0, v = 0;

    [[nodiscard]] auto name() const { return std::tuple(instance, geometry, prim); }
    [[nodiscard]] bool found() const { return prim != no_primitive; }
};

/// First contacts; at equal t the least name.
struct NearContact {
    float t;
    std::uint32_t instance = no_primitive, geometry = no_primitive, prim = no_primitive;
    LeafTriangle triangle{};  // in the world
    float u = 0, v = 0;       // of a ray
    bool turned = false;      // its second and third corner changed places

    [[nodiscard]] auto order() const { return std::tuple(t, instance, geometry, prim); }
    [[nodiscard]] bool found() const { return prim != no_primitive; }
};

/// What several queries of a thread share.
struct NearJob {
    const SceneTree* tree = nullptr;
    std::uint32_t mask = 0;
    NearStack stack;
    NearGuess guess;  // changes nothing but the time
};

struct NearKernels {
    std::string_view isa;
    /// The least (d2, name) with d2 <= limit. The query must be finite.
    NearBest (*closest)(NearJob& job, Vec3 query, float limit);
    /// Valid queries. Those touched behind `found`, a primitive more than once perhaps; null: the
    /// first ends the search. Whether there is any.
    bool (*touch_sphere)(NearJob& job, const Sphere& sphere, BudgetVector<ScenePrimitive>* found);
    bool (*touch_segment)(NearJob& job, const Segment& segment,
                          BudgetVector<ScenePrimitive>* found);
    /// A valid sweep; t in units of the path, or if the radius is 0, of the ray's frame.
    NearContact (*sweep)(NearJob& job, const SphereSweep& sweep);
};

/// Empty: the best. The names are those of simd_kernels().
[[nodiscard]] const NearKernels& near_kernels_for(std::string_view isa);

}  // namespace raydix
