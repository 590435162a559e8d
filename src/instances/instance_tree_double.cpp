#include "instances/instance_tree_double.h"

#include <algorithm>
#include <cmath>

#include "exec/parallel.h"
#include "primitives/double_sources.h"
#include "tree/around_center.h"
#include "tree/median_center.h"

namespace raydix {

bool in_range(const ExtentD& extent) { return in_range(extent.box.lo) && in_range(extent.box.hi); }

void InstanceTreeD::build(BvhBuilder& builder, const BuildOptions& options) {
    around = {nothing_d, 0.0};
    for (const ExtentD& extent : extents) {
        if (is_empty(extent)) continue;
        around.box = {min_of(around.box.lo, extent.box.lo), max_of(around.box.hi, extent.box.hi)};
        around.error = std::max(around.error, extent.error);
    }
    const auto box_at = [&](std::size_t i, AabbD& box) {
        box = extents[i].box;
        return !is_empty(extents[i]);
    };
    const Vec3d center = median_center(extents.size(), box_at, around.box);
    space = {center, scale_around(center, around.box)};
    boxes.resize(extents.size());
    for_each_index(extents.size(), [&](std::size_t i) {
        AabbD box;
        boxes[i] = box_at(i, box) ? box_around_center(box, space.center, space.scale) : empty_box();
    });
    BuildOptions single = options;
    single.max_leaf = 1;
    builder.build(boxes, single, bvh);
}

double InstanceNodesD::room(const InstanceTreeD& tree, Vec3d origin) {
    const BvhNode& root = tree.bvh.nodes()[0];
    const auto largest = [](double x, double y, double z) { return max_of(max_of(x, y), z); };
    const auto reach = [](float lo, float hi, double o) {
        return max_of(std::fabs(lo - o), std::fabs(hi - o));
    };
    const double far =
        largest(reach(root.lo.x, root.hi.x, origin.x), reach(root.lo.y, root.hi.y, origin.y),
                reach(root.lo.z, root.hi.z, origin.z));
    const double from = largest(std::fabs(origin.x), std::fabs(origin.y), std::fabs(origin.z));
    return tree.around.error * far + 0x1p-49 * (far + from);
}

}  // namespace raydix
