// What raydix/device_trees.h does on the host: sizes, and trees that come back.
#include "gpu/device_trees.h"

#include <algorithm>

#include "gpu/device_assemble.h"
#include "gpu/device_fetch.h"

namespace raydix {
namespace {

/// Complete once the stream has been waited for.
auto fetch_on(Stream stream) {
    return [stream](auto& out, const auto* device, std::size_t size) {
        fetch(out, device, size, stream);
    };
}

}  // namespace

std::size_t device_node_capacity(std::uint32_t n, PrimitiveKind kind,
                                 const KdTreeOptions& options) {
    const std::uint32_t inner = inner_limit(n, resolved(options, kind, n));
    check_kd_inner(inner, n);
    return 2 * std::size_t{inner} + 2;
}

std::uint64_t device_node_bound(std::uint32_t n, const OctreeOptions& options) {
    const OctreeOptions full = resolved(options, n);
    // No more leaves than points, and on each level above the last no more divided nodes than cells
    // and than nodes that hold more than a leaf may.
    const std::uint64_t most_divided = n / (static_cast<std::uint64_t>(full.max_leaf) + 1);
    std::uint64_t nodes = n, cells = 1;
    for (int level = 0; level < full.max_level; ++level) {
        nodes += std::min(cells, most_divided);
        cells = std::min<std::uint64_t>(8 * cells, n);
    }
    return nodes;
}

KdTree download_kdtree(const DeviceKdArrays& tree, PrimitiveKind kind, const KdTreeOptions& options,
                       Stream stream) {
    KdTree result =
        assemble_kdtree(tree, fetch_counts(tree.counts, stream), kind, options, fetch_on(stream));
    synchronize(stream);
    return result;
}

Octree download_octree(const DeviceOctreeArrays& tree, PrimitiveKind kind,
                       const OctreeOptions& options, Stream stream) {
    Octree result =
        assemble_octree(tree, fetch_counts(tree.counts, stream), kind, options, fetch_on(stream));
    synchronize(stream);
    return result;
}

DeviceKdTree::DeviceKdTree(PrimitiveKind kind, std::uint32_t n, const KdTreeOptions& options)
    : kind_(kind),
      capacity_(n),
      options_(options),
      scratch_(device_scratch_bytes(n, kind, options)) {
    nodes_.reset(device_node_capacity(n, kind, options));
    order_.reset(n);
    counts_.reset(1);
    if (kind == PrimitiveKind::triangles) triangles_.reset(n);
    if (kind == PrimitiveKind::points) points_.reset(n);
}

void DeviceKdTree::build(const DeviceMesh& mesh, Stream stream) {
    check_device_input(kind_of(mesh), count_of(mesh), kind_, capacity_);
    build_kdtree_on_device(mesh, options_, tree(), {scratch_.data(), scratch_.size()}, stream);
}

BuildMs DeviceKdTree::build_timed(const DeviceMesh& mesh, Stream stream) {
    check_device_input(kind_of(mesh), count_of(mesh), kind_, capacity_);
    return time_kdtree_on_device(mesh, options_, tree(), {scratch_.data(), scratch_.size()},
                                 stream);
}

DeviceKdArrays DeviceKdTree::tree() const {
    return {nodes_.data(), order_.data(), triangles_.data(), points_.data(), counts_.data()};
}

KdTree DeviceKdTree::download(Stream stream) const {
    return download_kdtree(tree(), kind_, options_, stream);
}

std::size_t DeviceKdTree::bytes() const {
    return nodes_.bytes() + order_.bytes() + triangles_.bytes() + points_.bytes() +
           counts_.bytes() + scratch_.bytes();
}

DeviceOctree::DeviceOctree(PrimitiveKind kind, std::uint32_t n, const OctreeOptions& options,
                           std::uint32_t node_capacity)
    : kind_(kind), capacity_(n), node_capacity_(node_capacity), options_(options) {
    if (node_capacity_ == 0)
        node_capacity_ = static_cast<std::uint32_t>(
            std::min(device_node_bound(n, options), 2 * std::uint64_t{n} + 64));
    scratch_.reset(device_scratch_bytes(n, node_capacity_, options));
    nodes_.reset(node_capacity_);
    order_.reset(n);
    points_.reset(n);
    counts_.reset(1);
}

void DeviceOctree::build(const DeviceMesh& mesh, Stream stream) {
    check_device_input(kind_of(mesh), count_of(mesh), kind_, capacity_);
    build_octree_on_device(mesh, options_, tree(), {scratch_.data(), scratch_.size()}, stream);
}

BuildMs DeviceOctree::build_timed(const DeviceMesh& mesh, Stream stream) {
    check_device_input(kind_of(mesh), count_of(mesh), kind_, capacity_);
    return time_octree_on_device(mesh, options_, tree(), {scratch_.data(), scratch_.size()},
                                 stream);
}

DeviceOctreeArrays DeviceOctree::tree() const {
    return {nodes_.data(), node_capacity_, order_.data(), points_.data(), counts_.data()};
}

std::uint32_t DeviceOctree::node_count(Stream stream) const {
    return fetch_counts(counts_.data(), stream).node_count;
}

Octree DeviceOctree::download(Stream stream) const {
    return download_octree(tree(), kind_, options_, stream);
}

std::size_t DeviceOctree::bytes() const {
    return nodes_.bytes() + order_.bytes() + points_.bytes() + counts_.bytes() + scratch_.bytes();
}

}  // namespace raydix
