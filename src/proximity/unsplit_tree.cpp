#include "proximity/unsplit_tree.h"

#include <vector>

#include "tree/bvh_double_internals.h"
#include "tree/bvh_internals.h"

namespace raydix {
namespace {

BvhInternals access_to(Bvh& bvh) { return {bvh}; }
BvhInternals access_to(BvhD& bvh) { return {BvhDInternals{bvh}.tree()}; }

template <class View, class Vec, class AnyBvh>
AnyBvh unsplit_tree_of(const AnyBvh& bvh) {
    std::vector<bool> seen(bvh.input_count());
    std::vector<Vec> corners;
    std::vector<Triangle> triangles;
    std::vector<std::uint32_t> prims;
    for (std::size_t k = 0; k < bvh.order().size(); ++k) {
        const std::uint32_t prim = bvh.order()[k];
        if (seen[prim]) continue;
        seen[prim] = true;
        const auto& t = bvh.triangles()[k];
        const auto first = static_cast<std::uint32_t>(corners.size());
        corners.insert(corners.end(), {t.v0, t.v1, t.v2});
        triangles.push_back({first, first + 1, first + 2});
        prims.push_back(prim);
    }
    AnyBvh whole = build_bvh(View(corners, triangles), {.builder = Builder::apetrei});
    for (std::uint32_t& prim : access_to(whole).order().span()) prim = prims[prim];
    return whole;
}

}  // namespace

Bvh make_unsplit_tree(const Bvh& bvh) { return unsplit_tree_of<MeshView, Vec3>(bvh); }
BvhD make_unsplit_tree(const BvhD& bvh) { return unsplit_tree_of<MeshViewD, Vec3d>(bvh); }

}  // namespace raydix
