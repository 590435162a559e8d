// A scene -> counts of its triangles.
#include <raydix/scene_info.h>

#include <unordered_set>

#include "base/math.h"
#include "engine/flat_scene.h"
#include "engine/scene_state.h"

namespace raydix {
namespace {

template <class Scalar>
BasicMeshInfo<Scalar> inspect_scene(const BasicScene<Scalar>& scene) {
    constexpr std::uint32_t all = ~std::uint32_t{0};
    BasicMeshInfo<Scalar> sum = inspect(BasicMeshView<Scalar>());
    FlatPlan<Scalar>(scene, all, "inspect", FlatShapes::left_out)
        .for_each_mesh([&](const BasicMeshView<Scalar>& mesh) {
            const BasicMeshInfo<Scalar> one = inspect(mesh);
            sum.bounds = {min_of(sum.bounds.lo, one.bounds.lo),
                          max_of(sum.bounds.hi, one.bounds.hi)};
            for (const auto member :
                 {&BasicMeshInfo<Scalar>::vertices, &BasicMeshInfo<Scalar>::triangles,
                  &BasicMeshInfo<Scalar>::non_finite_vertices,
                  &BasicMeshInfo<Scalar>::out_of_range_vertices,
                  &BasicMeshInfo<Scalar>::unreferenced_vertices,
                  &BasicMeshInfo<Scalar>::zero_area_triangles,
                  &BasicMeshInfo<Scalar>::repeated_index_triangles,
                  &BasicMeshInfo<Scalar>::left_out_triangles, &BasicMeshInfo<Scalar>::bytes})
                sum.*member += one.*member;
        });
    return sum;
}

/// `seen`: scenes that are counted already.
template <class Tree>
std::uint64_t left_out_of(const Tree& scene, std::unordered_set<const Tree*>& seen) {
    if (!seen.insert(&scene).second) return 0;
    std::uint64_t sum = 0;
    for (const auto& mesh : scene.meshes) sum += mesh->left_out;
    for (const auto& instance : scene.instances) sum += left_out_of<Tree>(*instance.scene, seen);
    return sum;
}

template <class Scalar>
std::uint64_t left_out_of_all(const BasicScene<Scalar>& scene) {
    std::unordered_set<const typename SceneKind<Scalar>::Tree*> seen;
    return left_out_of(*BasicSceneInternals<Scalar>::tree(scene), seen);
}

}  // namespace

MeshInfo inspect(const Scene& scene) { return inspect_scene(scene); }
MeshInfoD inspect(const SceneD& scene) { return inspect_scene(scene); }
std::uint64_t left_out_triangles(const Scene& scene) { return left_out_of_all(scene); }
std::uint64_t left_out_triangles(const SceneD& scene) { return left_out_of_all(scene); }

}  // namespace raydix
