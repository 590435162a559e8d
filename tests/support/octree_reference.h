// The octree from its definition: points go in one at a time, and a leaf that gets too many is
// split. Recursive, serial, slow and short. What the parallel builder makes is compared with it.
#pragma once

#include <raydix/octree.h>

#include <span>
#include <string>
#include <vector>

namespace raydix::test {

struct ReferenceOctree {
    std::vector<OctreeNode> nodes;  // level by level, by code within a level
    std::vector<std::uint32_t> order;
    std::vector<Vec3> points;  // in leaf order
    Aabb bounds;
    std::uint64_t left_out = 0;
};

/// options.max_level may be -1. `reversed`: the last point goes in first; the tree must not depend
/// on it.
ReferenceOctree reference_octree(std::span<const Vec3> points, const OctreeOptions& options,
                                 bool reversed = false);

/// The first difference in bounds, nodes, order or points; empty if there is none.
std::string difference(const Octree& built, const ReferenceOctree& expected);

}  // namespace raydix::test
