// Whether rays widen the boxes of a tree by the size of what is near, not of all.
#pragma once

#include "layout/wide_bvh.h"

namespace raydix {

/// Sets local_pads: whether most leaves are small beside what rays add to all boxes of the tree,
/// which is in proportion to the root's. One stray vertex or a wide ground is enough. Looks at some
/// nodes. Planes of such a tree are then put about the median of its leaves, where floats are
/// finest (median_center.h). Not for trees that hold a triangle more than once: parts of it may lie
/// in boxes far smaller than itself. Depends on the triangles, the nodes' links and the bounds.
void settle_local_pads(WideBvh::Arrays& arrays);

/// Of a plain tree with local pads: its nodes with planes about the middle of the bounds, as files
/// have them.
[[nodiscard]] Buffer<WideNode> nodes_about_center(const WideBvh::Arrays& arrays);

}  // namespace raydix
