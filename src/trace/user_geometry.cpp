// Rays through boxes with a function of the caller's, in float.
#include <raydix/user_geometry.h>

#include "trace/user_walk.h"

namespace raydix {
namespace {

struct BoxTree {
    using Scalar = float;
    using AnyRay = Ray;
    using AnyHit = Hit;
    using Intersect = IntersectPrimitive;
    /// Nodes are entered up to here beyond the best hit, since the function's arithmetic is not
    /// that of the boxes.
    static constexpr float reach_factor = 1.0f + 0x1p-16f;

    const BvhNode* nodes;
    const std::uint32_t* order;
    std::uint32_t max_depth;
    bool empty;

    explicit BoxTree(const Bvh& bvh)
        : nodes(bvh.nodes().data()),
          order(bvh.order().data()),
          max_depth(bvh.max_depth()),
          empty(bvh.empty()) {}

    [[nodiscard]] SlabFrame slabs(const RayFrame& ray) const {
        return make_slab_frame(ray, {nodes[0].lo, nodes[0].hi});
    }
    [[nodiscard]] float enter_from(float tmin) const { return tmin; }
};

}  // namespace

TraceCounts trace(const Bvh& boxes, const IntersectPrimitive& intersect, std::span<const Ray> rays,
                  std::span<Hit> hits, const TraceOptions& options) {
    return trace_user(BoxTree(boxes), intersect, rays, hits, options);
}

TraceCounts trace_any(const Bvh& boxes, const IntersectPrimitive& intersect,
                      std::span<const Ray> rays, std::span<std::uint8_t> occluded,
                      const TraceOptions& options) {
    return trace_any_user(BoxTree(boxes), intersect, rays, occluded, options);
}

Hit closest_hit(const Bvh& boxes, const IntersectPrimitive& intersect, const Ray& ray) {
    return trace_one_user(BoxTree(boxes), intersect, ray, false);
}

bool any_hit(const Bvh& boxes, const IntersectPrimitive& intersect, const Ray& ray) {
    return trace_one_user(BoxTree(boxes), intersect, ray, true).hit();
}

}  // namespace raydix
