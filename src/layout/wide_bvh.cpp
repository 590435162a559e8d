#include "layout/wide_bvh.h"

#include <bit>
#include <cstdint>

#include "layout/cluster_view.h"
#include "layout/wide_emit.h"

namespace raydix {

struct WideScratch::Memory {
    PartPool pool;
};

WideScratch::WideScratch() : memory(std::make_unique<Memory>()) {}
WideScratch::~WideScratch() = default;

namespace {

/// The largest float that is at most a - b, for floats of at most 1e12. Without branches.
float difference_below(float a, float b) {
    // What rounding took, exactly (Knuth's two-sum).
    const float rounded = a - b, of_b = rounded - a;
    const float error = (a - (rounded - of_b)) - (b + of_b);
    // The next float down has the next smaller magnitude, or of a negative one the next larger; a
    // difference of 0 is exact.
    const auto bits = std::bit_cast<std::int32_t>(rounded);
    const std::int32_t down = bits < 0 ? bits + 1 : bits - 1;
    return std::bit_cast<float>(error < 0 ? down : bits);
}

template <class View>
void make_layout(const View& view, const WideOptions& options, WideBvh::Arrays& out,
                 WideScratch::Memory& memory) {
    if (options.width == 4)
        WideEmitter<4, View>(view, options, memory.pool).run(out);
    else
        WideEmitter<8, View>(view, options, memory.pool).run(out);
}

}  // namespace

void set_boxes_about(Vec3 middle, const SlotBoxes& boxes, WideNode& node) {
    for (int axis = 0; axis < 3; ++axis) {
        const float from = coordinate(middle, axis);
        for (int s = 0; s < quantised_width; ++s) {
            const bool used = (boxes.used >> s & 1) != 0;
            const float lo = difference_below(boxes.lo[axis][s], from);
            const float hi = -difference_below(from, boxes.hi[axis][s]);
            node.lo[axis][s] = used ? lo : infinity;
            node.hi[axis][s] = used ? hi : -infinity;
        }
    }
}

void make_wide_layout(const Bvh& bvh, const WideOptions& options, WideBvh::Arrays& out,
                      WideScratch& scratch) {
    BinaryView view(bvh, options.max_leaf);
    if (options.compact) view.weld();
    make_layout(view, options, out, *scratch.memory);
}

void make_wide_layout(ClusterView& clusters, const WideOptions& options, WideBvh::Arrays& out,
                      WideScratch& scratch) {
    if (options.compact) clusters.weld();
    make_layout(clusters, options, out, *scratch.memory);
}

}  // namespace raydix
