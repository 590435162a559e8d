// Every ray against every triangle with the very test the kernels use. What a tree must agree with,
// bit for bit.
#include <raydix/error.h>
#include <raydix/trace.h>

#include "exec/parallel.h"
#include "primitives/sources.h"
#include "trace/triangle_test.h"

namespace raydix {
namespace {

Hit closest_of_all(const TriangleSource& source, std::uint32_t count, const Ray& ray) {
    if (!is_valid(ray)) return {};
    const RayFrame frame = make_frame(ray);
    Hit best{frame.tmax, no_primitive, 0.0f, 0.0f};
    for (std::uint32_t i = 0; i < count; ++i) {
        Aabb box;
        if (!source.box(i, box)) continue;
        const LeafTriangle triangle{source.corner(i, 0), source.corner(i, 1), source.corner(i, 2)};
        TriangleHit hit;
        if (!intersect_triangle<EdgeRule::closed>(frame, triangle, best.t, hit)) continue;
        // Ids ascend, so that an equal t never replaces an earlier hit.
        if (hit.t < best.t || !best.hit()) best = {hit.t, i, hit.u, hit.v};
    }
    if (!best.hit()) return {};
    best.t *= frame.t_scale;
    return best;
}

}  // namespace

std::vector<Hit> trace_brute_force(const MeshView& mesh, std::span<const Ray> rays, int threads) {
    const TriangleSource source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
    for (std::uint32_t i = 0; i < count; ++i)
        if (!source.readable(i))
            throw InputError("triangle " + std::to_string(i) + ": index past the last vertex");
    std::vector<Hit> hits(rays.size());
    with_threads(threads, [&] {
        for_each_index(
            rays.size(), [&](std::size_t i) { hits[i] = closest_of_all(source, count, rays[i]); },
            16);
    });
    return hits;
}

}  // namespace raydix
