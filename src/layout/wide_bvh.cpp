#include "layout/wide_bvh.h"

#include <cmath>

#include "layout/cluster_view.h"
#include "layout/wide_emit.h"

namespace raydix {

struct WideScratch::Memory {
    std::vector<WidePart> parts;
};

WideScratch::WideScratch() : memory(std::make_unique<Memory>()) {}
WideScratch::~WideScratch() = default;

namespace {

/// The largest float that is at most x. (What x itself lacks, as a difference of two floats, is
/// less than 2^-53 of it; the pads of rays have room for that.)
float rounded_down(double x) {
    const auto nearest = static_cast<float>(x);
    return nearest <= x ? nearest : std::nextafter(nearest, -infinity);
}

template <class View>
void make_layout(const View& view, const WideOptions& options, WideBvh::Arrays& out,
                 WideScratch::Memory& memory) {
    if (options.width == 4)
        WideEmitter<4, View>(view, options, memory.parts).run(out);
    else
        WideEmitter<8, View>(view, options, memory.parts).run(out);
}

}  // namespace

void set_boxes_about(Vec3 middle, const SlotBoxes& boxes, WideNode& node) {
    for (int axis = 0; axis < 3; ++axis) {
        const double from = coordinate(middle, axis);
        for (int s = 0; s < quantised_width; ++s) {
            const bool used = (boxes.used >> s & 1) != 0;
            node.lo[axis][s] = used ? rounded_down(boxes.lo[axis][s] - from) : infinity;
            node.hi[axis][s] = used ? -rounded_down(from - boxes.hi[axis][s]) : -infinity;
        }
    }
}

void make_wide_layout(const Bvh& bvh, const WideOptions& options, WideBvh::Arrays& out,
                      WideScratch& scratch) {
    BinaryView view(bvh, options.max_leaf);
    if (options.compact) view.weld();
    make_layout(view, options, out, *scratch.memory);
}

void make_wide_layout(const ClusterView& clusters, const WideOptions& options, WideBvh::Arrays& out,
                      WideScratch& scratch) {
    make_layout(clusters, options, out, *scratch.memory);
}

}  // namespace raydix
