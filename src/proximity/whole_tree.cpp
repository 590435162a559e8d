#include "proximity/whole_tree.h"

#include <vector>

#include "exec/parallel.h"
#include "tree/bvh_access.h"

namespace raydix {

Bvh make_whole_tree(const Bvh& bvh) {
    std::vector<bool> seen(bvh.input_count());
    std::vector<Vec3> corners;
    std::vector<Triangle> triangles;
    std::vector<std::uint32_t> prims;
    for (std::size_t k = 0; k < bvh.order().size(); ++k) {
        const std::uint32_t prim = bvh.order()[k];
        if (seen[prim]) continue;
        seen[prim] = true;
        const LeafTriangle& t = bvh.triangles()[k];
        const auto first = static_cast<std::uint32_t>(corners.size());
        corners.insert(corners.end(), {t.v0, t.v1, t.v2});
        triangles.push_back({first, first + 1, first + 2});
        prims.push_back(prim);
    }
    Bvh whole = build_bvh(MeshView(corners, triangles), {.builder = Builder::apetrei});
    const BvhAccess access{whole};
    for (std::uint32_t& prim : access.order().span()) prim = prims[prim];
    return whole;
}

}  // namespace raydix
