// Every ray against every triangle with the very test the kernels use. What a tree must agree with,
// bit for bit.
#include <raydix/double.h>
#include <raydix/error.h>
#include <raydix/trace.h>

#include "exec/parallel.h"
#include "primitives/double_sources.h"
#include "primitives/sources.h"
#include "trace/triangle_test.h"

namespace raydix {
namespace {

template <class Source, class AnyRay, class AnyHit>
void closest_of_all(const Source& source, std::uint32_t count, const AnyRay& ray, AnyHit& best) {
    using Scalar = decltype(best.t);
    best = {};
    if (!is_valid(ray)) return;
    const BasicRayFrame<Scalar> frame = make_frame(ray);
    best.t = frame.tmax;
    for (std::uint32_t i = 0; i < count; ++i) {
        BasicAabb<Scalar> box;
        if (!source.box(i, box)) continue;
        BasicTriangleHit<Scalar> hit;
        if (!intersect_triangle<EdgeRule::closed>(frame, source.corners(i), best.t, hit)) continue;
        // Ids ascend, so that an equal t never replaces an earlier hit.
        if (hit.t < best.t || !best.hit())
            best.t = hit.t, best.prim = i, best.u = hit.u, best.v = hit.v;
    }
    if (!best.hit())
        best = {};
    else
        best.t *= frame.t_scale;
    best = hit_of_tree(best);
}

template <class AnyHit, class Source, class View, class AnyRay>
std::vector<AnyHit> brute_force(const View& mesh, std::span<const AnyRay> rays, int threads) {
    const Source source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
    for (std::uint32_t i = 0; i < count; ++i)
        if (!source.readable(i))
            throw InputError("triangle " + std::to_string(i) + ": index past the last vertex");
    std::vector<AnyHit> hits(rays.size());
    with_threads(threads, [&] {
        for_each_index(
            rays.size(), [&](std::size_t i) { closest_of_all(source, count, rays[i], hits[i]); },
            16);
    });
    return hits;
}

}  // namespace

std::vector<Hit> trace_brute_force(const MeshView& mesh, std::span<const Ray> rays, int threads) {
    return brute_force<Hit, TriangleSource>(mesh, rays, threads);
}

std::vector<HitD> trace_brute_force(const MeshViewD& mesh, std::span<const RayD> rays,
                                    int threads) {
    return brute_force<HitD, TriangleSourceD>(mesh, rays, threads);
}

}  // namespace raydix
