#include "layout/wide_bvh.h"

#include <memory>

#include "layout/cluster_view.h"
#include "layout/wide_emit.h"
#include "layout/wide_scratch.h"

namespace raydix {

WideScratch::WideScratch() : memory(std::make_unique<Memory>()) {}
WideScratch::~WideScratch() = default;

namespace {

template <class View>
void make_layout(const View& view, const WideOptions& options, WideBvh::Arrays& out,
                 WideScratch::Memory& memory) {
    if (options.width == 4)
        WideEmitter<4, View>(view, options, memory.pool).run(out);
    else
        WideEmitter<8, View>(view, options, memory.pool).run(out);
}

}  // namespace

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
