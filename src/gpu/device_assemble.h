// Arrays of a k-d tree or an octree that a build of device_trees.h left behind -> the tree of the
// host. `fetch(buffer, from, n)` copies: from a device, or in tests from the host.
#pragma once

#include <raydix/device_trees.h>
#include <raydix/error.h>

#include <string>

#include "build/octree_kdtree_options.h"
#include "tree/kdtree_internals.h"
#include "tree/octree_internals.h"

namespace raydix {

template <class Access>
void take_input_counts(const Access& access, const DeviceInputCounts& counts, PrimitiveKind kind) {
    access.kind() = kind;
    access.input_count() = counts.input_count;
    access.left_out() = counts.left_out;
    if (counts.references != 0) access.bounds() = counts.bounds;
}

/// Throws as check_counts does.
template <class Fetch>
KdTree assemble_kdtree(const DeviceKdArrays& tree, const DeviceCounts& counts, PrimitiveKind kind,
                       const KdTreeOptions& options, const Fetch& fetch) {
    check_counts(counts, kind, options.strict);
    KdTree result;
    const KdTreeInternals access{result};
    access.options() = resolved(options, kind, counts.input_count);
    take_input_counts(access, counts, kind);
    access.inner_count() = counts.inner_count;
    access.max_depth() = counts.max_depth;
    const std::size_t n = counts.references;
    if (n == 0) return result;
    fetch(access.nodes(), tree.nodes, 2 * std::size_t{counts.inner_count} + 2);
    fetch(access.order(), tree.order, n);
    if (kind == PrimitiveKind::triangles)
        fetch(access.triangles(), tree.triangles, n);
    else
        fetch(access.points(), tree.points, n);
    return result;
}

/// Throws as check_counts does, and if there was too little room.
template <class Fetch>
Octree assemble_octree(const DeviceOctreeArrays& tree, const DeviceOctreeCounts& counts,
                       PrimitiveKind kind, const OctreeOptions& options, const Fetch& fetch) {
    check_counts(counts, kind, options.strict);
    if (counts.node_count > tree.node_capacity)
        throw InputError("the octree has " + std::to_string(counts.node_count) +
                         " nodes; there is room for " + std::to_string(tree.node_capacity));
    Octree result;
    const OctreeInternals access{result};
    access.options() = resolved(options, counts.input_count);
    take_input_counts(access, counts, kind);
    const std::size_t n = counts.references;
    if (n == 0) return result;
    // Behind max_level there are no nodes.
    const auto used = static_cast<std::size_t>(access.options().max_level) + 2;
    for (std::size_t k = 0; k < access.level_begin().size(); ++k)
        access.level_begin()[k] = k < used ? counts.level_begin[k] : counts.node_count;
    fetch(access.nodes(), tree.nodes, counts.node_count);
    fetch(access.order(), tree.order, n);
    fetch(access.points(), tree.points, n);
    return result;
}

}  // namespace raydix
