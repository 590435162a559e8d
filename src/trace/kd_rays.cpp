// Batches of rays over threads, each through the k-d tree by walk_kd_tree. The triangle test is the
// one of every kernel, so hits equal those of a BVH bit for bit.
#include <raydix/error.h>
#include <raydix/kdtree.h>

#include <string>

#include "trace/kd_walk.h"
#include "trace/scalar_batch.h"
#include "trace/triangle_test.h"

namespace raydix {
namespace {

struct KdRayTree : KdTreeView {
    using Scalar = float;

    const LeafTriangle* triangles;

    explicit KdRayTree(const KdTree& tree) : KdTreeView(tree), triangles(tree.triangles().data()) {}
};

KdStack<KdRayPart> stack_of(const KdRayTree& tree) { return KdStack<KdRayPart>(tree.max_depth); }

template <class Steps>
ClosestHit find_closest(const KdRayTree& tree, const RayFrame& ray, KdStack<KdRayPart>& stack,
                        Steps& steps) {
    ClosestHit best{ray.tmax};
    const auto leaf = [&](const KdNode& node) {
        for (std::uint32_t i = node.first; i < node.first + node.count(); ++i) {
            TriangleHit hit;
            count_test(steps);
            if (!intersect_triangle<EdgeRule::closed>(ray, tree.triangles[i], best.t, hit))
                continue;
            // At equal t the lower primitive id wins, whatever order the leaves come in.
            if (hit.t < best.t || tree.order[i] < best.prim)
                best = {hit.t, tree.order[i], i, hit.u, hit.v};
        }
        return false;
    };
    walk_kd_tree(tree, ray, stack, steps, leaf, [&] { return best.t; });
    return best;
}

template <class Steps>
bool find_any(const KdRayTree& tree, const RayFrame& ray, KdStack<KdRayPart>& stack, Steps& steps) {
    bool found = false;
    const auto leaf = [&](const KdNode& node) {
        for (std::uint32_t i = node.first; i < node.first + node.count() && !found; ++i) {
            TriangleHit hit;
            count_test(steps);
            found = intersect_triangle<EdgeRule::closed>(ray, tree.triangles[i], ray.tmax, hit);
        }
        return found;
    };
    walk_kd_tree(tree, ray, stack, steps, leaf, [&] { return ray.tmax; });
    return found;
}

void check_call(const KdTree& tree, std::size_t rays, std::size_t results) {
    if (rays != results)
        throw InputError("kd_trace: " + std::to_string(rays) + " rays, but room for " +
                         std::to_string(results) + " results");
    if (tree.kind() != PrimitiveKind::triangles && !tree.empty())
        throw InputError("rays need triangles; this tree holds points");
}

}  // namespace

TraceCounts kd_trace(const KdTree& tree, std::span<const Ray> rays, std::span<Hit> hits,
                     const TraceOptions& options) {
    check_call(tree, rays.size(), hits.size());
    return on_threads(options, [&](auto steps) {
        return closest_batch<decltype(steps)>(KdRayTree(tree), rays, hits);
    });
}

std::vector<Hit> kd_trace(const KdTree& tree, std::span<const Ray> rays,
                          const TraceOptions& options) {
    std::vector<Hit> hits(rays.size());
    kd_trace(tree, rays, hits, options);
    return hits;
}

TraceCounts kd_trace_any(const KdTree& tree, std::span<const Ray> rays,
                         std::span<std::uint8_t> occluded, const TraceOptions& options) {
    check_call(tree, rays.size(), occluded.size());
    return on_threads(options, [&](auto steps) {
        return any_batch<decltype(steps)>(KdRayTree(tree), rays, occluded);
    });
}

}  // namespace raydix
