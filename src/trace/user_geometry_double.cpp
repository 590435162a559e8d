// Rays through boxes in double with a function of the caller's: float nodes around a center.
#include <raydix/user_geometry_d.h>

#include <cmath>

#include "trace/double_tree.h"
#include "trace/user_walk.h"

namespace raydix {
namespace {

struct BoxTreeD {
    using Scalar = double;
    using AnyRay = RayD;
    using AnyHit = HitD;
    using Intersect = IntersectPrimitiveD;
    /// Twice the part of t that the function may be off by.
    static constexpr double reach_factor = 1.0 + 0x1p-40;

    const BvhNode* nodes;
    const std::uint32_t* order;
    std::uint32_t max_depth;
    bool empty;
    TreeSpace space;

    explicit BoxTreeD(const BoxBvhD& bvh)
        : nodes(bvh.tree().nodes().data()),
          order(bvh.order().data()),
          max_depth(bvh.max_depth()),
          empty(bvh.empty()),
          space{bvh.center(), bvh.scale()} {}

    /// All boxes larger by twice the part of the distance to the root's far side that the function
    /// may be off by. It also holds what the origin loses on its way to the nodes.
    [[nodiscard]] SlabFrameD slabs(const RayFrameD& ray) const {
        const BvhNode& root = nodes[0];
        SlabFrameD frame = make_slab_frame(space.local(ray), {root.lo, root.hi});
        const auto reach = [](float lo, float hi, double o) {
            return max_of(std::fabs(lo - o), std::fabs(hi - o));
        };
        const Vec3d o = frame.origin;
        const double room = 0x1p-43 * max_of(max_of(reach(root.lo.x, root.hi.x, o.x),
                                                    reach(root.lo.y, root.hi.y, o.y)),
                                             reach(root.lo.z, root.hi.z, o.z));
        const auto near = [&](double pad) { return std::copysign(room, pad); };
        frame.near_pad = {near(frame.near_pad.x), near(frame.near_pad.y), near(frame.near_pad.z)};
        frame.far_pad = -1.0 * frame.near_pad;
        return frame;
    }
    /// A box whose exit is off by as much as its entry may be.
    [[nodiscard]] double enter_from(double tmin) const { return tmin * (1.0 - 0x1p-40); }
};

}  // namespace

TraceCounts trace(const BoxBvhD& boxes, const IntersectPrimitiveD& intersect,
                  std::span<const RayD> rays, std::span<HitD> hits, const TraceOptions& options) {
    return trace_user(BoxTreeD(boxes), intersect, rays, hits, options);
}

TraceCounts trace_any(const BoxBvhD& boxes, const IntersectPrimitiveD& intersect,
                      std::span<const RayD> rays, std::span<std::uint8_t> occluded,
                      const TraceOptions& options) {
    return trace_any_user(BoxTreeD(boxes), intersect, rays, occluded, options);
}

HitD closest_hit(const BoxBvhD& boxes, const IntersectPrimitiveD& intersect, const RayD& ray) {
    return trace_one_user(BoxTreeD(boxes), intersect, ray, false);
}

bool any_hit(const BoxBvhD& boxes, const IntersectPrimitiveD& intersect, const RayD& ray) {
    return trace_one_user(BoxTreeD(boxes), intersect, ray, true).hit();
}

}  // namespace raydix
