// The public wide tree: binary tree -> wide tree -> nodes and blocks of triangles, and its figures.
#include <raydix/error.h>
#include <raydix/wide.h>

#include <cmath>
#include <string>

#include "base/float_env.h"
#include "base/math.h"
#include "exec/parallel.h"
#include "layout/wide_bvh.h"
#include "layout/wide_collapse.h"
#include "measure/stopwatch.h"

namespace raydix {
namespace {

/// As decoded; in double, to within a rounding.
double decoded_half_area(const WideNode& node, int slot) {
    double size[3];
    for (int axis = 0; axis < 3; ++axis)
        size[axis] = (node.hi[axis][slot] - node.lo[axis][slot]) *
                     std::ldexp(1.0, node.exponent[axis] - 127);
    return size[0] * size[1] + size[1] * size[2] + size[2] * size[0];
}

void add_widening(double exact, WideBvh::Arrays& arrays) {
    double quantised = 0;
    for (const WideNode& node : arrays.nodes.view())
        for (int slot = 0; slot < quantised_width; ++slot)
            if ((node.used >> slot & 1) != 0) quantised += decoded_half_area(node, slot);
    arrays.stats.widening = exact > 0 ? quantised / exact : 1.0;
}

void add_counts(WideBvhStats& stats, const WideBvh::Arrays& arrays) {
    std::uint64_t children = 0;
    for (const WideNode& node : arrays.nodes.view())
        for (int slot = 0; slot < quantised_width; ++slot) {
            const std::uint32_t word = node.child[slot];
            if (word == wide_no_child) continue;
            ++children;
            if ((word & wide_leaf_bit) == 0) continue;
            ++stats.leaves;
            stats.references += (word & 7) + 1;
        }
    stats.nodes = arrays.nodes.size();
    if (stats.nodes > 0)
        stats.children_per_node = static_cast<double>(children) / static_cast<double>(stats.nodes);
    stats.node_bytes = arrays.nodes.size() * sizeof(WideNode);
    stats.triangle_bytes = arrays.blocks.size() * sizeof(TriangleBlock);
    stats.bytes = stats.node_bytes + stats.triangle_bytes;
}

}  // namespace

WideBvh::WideBvh(const Bvh& bvh, const WideBvhOptions& options)
    : arrays_(std::make_unique<Arrays>()) {
    const WideOptions collapse{.width = options.width,
                               .max_leaf = wide_max_leaf,
                               .node_cost = 1.0,
                               .primitive_cost = wide_primitive_cost,
                               .block = wide_block};
    check_wide_options(collapse);
    arrays_->stats.width = options.width;
    arrays_->stats.widening = 1.0;
    if (bvh.empty()) return;
    if (bvh.kind() != PrimitiveKind::triangles)
        throw InputError(std::string("rays need triangles; this tree holds ") +
                         (bvh.kind() == PrimitiveKind::points ? "points" : "boxes"));
    const FloatEnvironment environment;
    with_threads(options.threads, [&] {
        Stopwatch watch;
        const WideTree wide = collapse_to_wide(bvh, collapse);
        const double area = make_wide_layout(wide, bvh, *arrays_);
        arrays_->stats.ms = watch.lap();
        arrays_->stats.max_depth = wide.max_depth;
        arrays_->stats.sah = wide_cost(wide, collapse);
        add_widening(area, *arrays_);
        add_counts(arrays_->stats, *arrays_);
    });
}

WideBvh::~WideBvh() = default;
WideBvh::WideBvh(WideBvh&&) noexcept = default;
WideBvh& WideBvh::operator=(WideBvh&&) noexcept = default;

bool WideBvh::empty() const { return arrays_->blocks.empty(); }
const WideBvhStats& WideBvh::stats() const { return arrays_->stats; }

}  // namespace raydix
