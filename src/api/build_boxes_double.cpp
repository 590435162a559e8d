// build_bvh over boxes in double: boxes -> center -> float boxes around it, with room for a
// caller's rounding -> a float tree.
#include <raydix/user_geometry_d.h>

#include "api/double_builds.h"
#include "measure/stopwatch.h"
#include "tree/around_center.h"

namespace raydix {

struct BoxBvhDAccess {
    BoxBvhD& bvh;

    [[nodiscard]] Bvh& tree() const { return bvh.tree_; }
    [[nodiscard]] BuildMs& build_ms() const { return bvh.build_ms_; }

    void place(const AabbD& bounds, Vec3d center) const {
        bvh.bounds_ = bounds;
        bvh.center_ = center;
        bvh.scale_ = scale_around(center, bounds);
    }
    /// Twice the room that is promised to functions of the caller's.
    [[nodiscard]] Aabb local(const AabbD& box) const {
        const Vec3d far = max_of(box.hi, -1.0 * box.lo);
        const double room = 0x1p-43 * max_of(max_of(far.x, far.y), far.z);
        const Vec3d on_all_sides{room, room, room};
        return box_around_center({box.lo - on_all_sides, box.hi + on_all_sides}, bvh.center_,
                                 bvh.scale_);
    }
};

namespace {

void build(std::span<const AabbD> input, const BuildOptions& options, const BoxBvhDAccess& tree) {
    Stopwatch total, stage;
    const std::size_t n = input.size();
    const BoxSourceD source{input.data()};
    const BoundsD bounds = bounds_of(source, n);
    if (options.strict && bounds.left_out != 0)
        throw InputError("box " + std::to_string(bounds.first_left_out) +
                         ": not finite, out of range or inverted, as are " +
                         std::to_string(bounds.left_out - 1) + " others");
    tree.place(bounds.box, center_of(source, n, bounds.box));
    BuildOptions over_floats = options;
    over_floats.strict = false;
    Buffer<Aabb> boxes;
    local_boxes(source, n, tree, boxes);
    const double before = stage.lap();
    tree.tree() = build_bvh(boxes.view(), over_floats);
    BuildMs ms = tree.tree().build_ms();
    ms.bounds += before;
    ms.total = total.lap();
    tree.build_ms() = ms;
}

}  // namespace

std::uint64_t BoxBvhD::bytes() const { return tree_.nodes().size_bytes() + order().size_bytes(); }

BoxBvhD build_bvh(std::span<const AabbD> boxes, const BuildOptions& options) {
    require_size(boxes.size());
    BoxBvhD bvh;
    with_threads(options.threads, [&] { build(boxes, options, {bvh}); });
    return bvh;
}

RefitQuality refit(BoxBvhD& bvh, std::span<const AabbD> boxes, int threads) {
    const std::size_t n = boxes.size();
    require_same_count(bvh, n, "boxes");
    const BoxSourceD source{boxes.data()};
    RefitQuality quality;
    with_threads(threads, [&] {
        quality =
            refit_around_center<BoxBvhDAccess>(bvh, source, bounds_of(source, n), "box", threads);
    });
    return quality;
}

}  // namespace raydix
