#include "layout/wide_bvh.h"

#include "layout/cluster_view.h"
#include "layout/wide_emit.h"

namespace raydix {

struct WideScratch::Memory {
    std::vector<WidePart> parts;
};

WideScratch::WideScratch() : memory(std::make_unique<Memory>()) {}
WideScratch::~WideScratch() = default;

namespace {

template <class View>
void make_layout(const View& view, const WideOptions& options, WideBvh::Arrays& out,
                 WideScratch::Memory& memory) {
    if (options.width == 4)
        WideEmitter<4, View>(view, options, memory.parts).run(out);
    else
        WideEmitter<8, View>(view, options, memory.parts).run(out);
}

}  // namespace

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
