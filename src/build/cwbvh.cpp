// The public compressed wide tree: binary tree -> wide tree -> compressed nodes, and its figures.
#include <raydix/cwbvh.h>
#include <raydix/error.h>

#include <cmath>
#include <string>

#include "base/float_env.h"
#include "base/math.h"
#include "base/options.h"
#include "exec/memory.h"
#include "exec/parallel.h"
#include "layout/cwbvh.h"
#include "layout/wide_collapse.h"

namespace raydix {
namespace {

/// As decoded; in double, to within a rounding.
double decoded_half_area(const CwbvhNode& node, int slot) {
    double size[3];
    for (int axis = 0; axis < 3; ++axis)
        size[axis] = (node.hi[axis][slot] - node.lo[axis][slot]) *
                     std::ldexp(1.0, node.exponent[axis] - 127);
    return size[0] * size[1] + size[1] * size[2] + size[2] * size[0];
}

double quantised_area(const Cwbvh::Arrays& arrays) {
    double sum = 0;
    for (const CwbvhNode& node : arrays.nodes.view())
        for (int slot = 0; slot < cwbvh_width; ++slot)
            if (node.meta[slot] != 0) sum += decoded_half_area(node, slot);
    return sum;
}

CwbvhStats stats_of(const WideTree& wide, const WideOptions& options, const Bvh& bvh,
                    const Cwbvh::Arrays& arrays) {
    CwbvhStats stats;
    stats.nodes = wide.node_count();
    double exact_area = 0;
    for (const BvhNode& child : wide.children.view()) {
        if (WideTree::is_unused(child)) continue;
        (WideTree::is_inner(child) ? stats.inner_children : stats.leaf_children) += 1;
        exact_area += half_area({child.lo, child.hi});
    }
    stats.references = arrays.triangles.size();
    stats.triangles = bvh.input_count() - bvh.left_out();
    stats.max_depth = wide.max_depth;
    stats.sah = wide_cost(wide, options);
    stats.widening = exact_area > 0 ? quantised_area(arrays) / exact_area : 1.0;
    stats.node_bytes = arrays.nodes.size() * sizeof(CwbvhNode);
    stats.triangle_bytes = arrays.triangles.size() * sizeof(CwbvhTriangle);
    stats.bytes = stats.node_bytes + stats.triangle_bytes;
    if (stats.nodes > 0)
        stats.children_per_node = static_cast<double>(stats.inner_children + stats.leaf_children) /
                                  static_cast<double>(stats.nodes);
    if (stats.triangles > 0)
        stats.bytes_per_triangle =
            static_cast<double>(stats.bytes) / static_cast<double>(stats.triangles);
    return stats;
}

}  // namespace

Cwbvh::Cwbvh(const Bvh& bvh, int threads) : arrays_(std::make_unique<Arrays>()) {
    check_threads(threads);
    if (bvh.empty()) return;
    if (bvh.kind() != PrimitiveKind::triangles)
        throw InputError(std::string("rays need triangles; this tree holds ") +
                         (bvh.kind() == PrimitiveKind::points ? "points" : "boxes"));
    const FloatEnvironment environment;
    const WideOptions options{.width = cwbvh_width, .max_leaf = cwbvh_max_leaf};
    const std::uint64_t before = memory_count().now();
    memory_count().restart_peak();
    with_threads(threads, [&] {
        const WideTree wide = collapse_to_wide(bvh, options);
        compress_wide_tree(wide, bvh, *arrays_);
        arrays_->stats = stats_of(wide, options, bvh, *arrays_);
    });
    arrays_->stats.peak_bytes = memory_count().peak() - before;
}

Cwbvh::~Cwbvh() = default;
Cwbvh::Cwbvh(Cwbvh&&) noexcept = default;
Cwbvh& Cwbvh::operator=(Cwbvh&&) noexcept = default;

const Cwbvh::Arrays& Cwbvh::nothing() {
    static const Arrays empty;
    return empty;
}

bool Cwbvh::empty() const { return arrays().nodes.empty(); }
const CwbvhStats& Cwbvh::stats() const { return arrays().stats; }

}  // namespace raydix
