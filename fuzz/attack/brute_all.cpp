// Every ray against every triangle, with the test that the kernels use, and no tree.
#include "attack/brute_all.h"

#include <algorithm>
#include <type_traits>

#include "primitives/double_sources.h"
#include "primitives/sources.h"
#include "trace/batch.h"
#include "trace/triangle_test.h"

namespace raydix::attack {
namespace {

template <class All, class Source, class View, class AnyRay>
All all_of(const View& mesh, std::span<const AnyRay> rays) {
    using Scalar = decltype(AnyRay::tmin);
    const Source source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
    All all;
    all.offsets.push_back(0);
    for (const AnyRay& ray : rays) {
        const auto first = static_cast<std::ptrdiff_t>(all.hits.size());
        if (is_valid(ray)) {
            const BasicRayFrame<Scalar> frame = make_frame(ray);
            for (std::uint32_t i = 0; i < count; ++i) {
                BasicAabb<Scalar> box;
                BasicTriangleHit<Scalar> hit;
                if (source.box(i, box) && intersect_triangle<EdgeRule::half_open>(
                                              frame, source.corners(i), frame.tmax, hit))
                    all.hits.push_back(hit_in_tree<typename decltype(All::hits)::value_type>(
                        hit.t * frame.t_scale, i, hit.u, hit.v));
            }
            std::sort(all.hits.begin() + first, all.hits.end(), [](const auto& a, const auto& b) {
                return a.t != b.t ? a.t < b.t : a.prim < b.prim;
            });
        }
        all.offsets.push_back(all.hits.size());
    }
    return all;
}

}  // namespace

AllHits brute_all(const MeshView& mesh, std::span<const Ray> rays) {
    return all_of<AllHits, TriangleSource>(mesh, rays);
}
AllHitsD brute_all(const MeshViewD& mesh, std::span<const RayD> rays) {
    return all_of<AllHitsD, TriangleSourceD>(mesh, rays);
}

}  // namespace raydix::attack
