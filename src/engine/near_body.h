// What queries of distance and overlap ask of a scene in double: all triangles on all paths as one
// mesh in the world, and a tree over it; and a tree over all spheres, capsules and points. Made
// when the first of them comes, and kept with the scene's tree.
#pragma once

#include <raydix/scene.h>

#include <cstdint>
#include <memory>
#include <utility>

#include "engine/flat_scene.h"
#include "engine/near_call.h"
#include "engine/near_shapes_double.h"
#include "exec/result_budget.h"
#include "proximity/closest_walk.h"

namespace raydix {

struct NearBodyD {
    NearBodyD(FlatTree<double> of, NearShapesD others)
        : triangles(std::move(of)), padded(triangles.tree), shapes(std::move(others)) {}

    const FlatTree<double> triangles;
    const PaddedTreeD padded;  // a view of it
    const NearShapesD shapes;
};

/// What a mask shows. Any number of threads may ask at once; one makes it while the others wait.
/// `budget`: of the call, charged with what has to be made; null: half of what is left. Throws
/// InputError: the scene was never committed, geometry that has no answer (require_answers);
/// ResultTooLarge.
[[nodiscard]] std::shared_ptr<const NearBodyD> near_body_of(const SceneD& scene, std::uint32_t mask,
                                                            NearCall call, ResultBudget* budget);

}  // namespace raydix
