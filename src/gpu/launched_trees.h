// k-d trees and octrees of device_trees.h on a stream of any machine.
#pragma once

#include "gpu/device_run.h"
#include "gpu/device_trees.h"
#include "gpu/launched_backend.h"

namespace raydix {

template <class Machine>
std::size_t LaunchedTrees<Machine>::scratch_bytes(std::uint32_t n, PrimitiveKind kind,
                                                  const KdTreeOptions& options) {
    static_cast<void>(this->name());  // says what is missing
    return kdtree_scratch_bytes<Machine>(n, kind, options);
}

template <class Machine>
void LaunchedTrees<Machine>::build(const DeviceMesh& mesh, const KdTreeOptions& options,
                                   const DeviceKdArrays& tree, Scratch scratch, Stream stream) {
    run_on_stream(this->machine_, build_of(mesh, options, tree), scratch, stream);
}

template <class Machine>
BuildMs LaunchedTrees<Machine>::time(const DeviceMesh& mesh, const KdTreeOptions& options,
                                     const DeviceKdArrays& tree, Scratch scratch, Stream stream) {
    return time_on_stream(this->machine_, build_of(mesh, options, tree), scratch, stream);
}

template <class Machine>
std::size_t LaunchedTrees<Machine>::scratch_bytes(std::uint32_t n, std::uint32_t node_capacity,
                                                  const OctreeOptions& options) {
    static_cast<void>(this->name());
    return octree_scratch_bytes<Machine>(n, node_capacity, options);
}

template <class Machine>
void LaunchedTrees<Machine>::build(const DeviceMesh& mesh, const OctreeOptions& options,
                                   const DeviceOctreeArrays& tree, Scratch scratch, Stream stream) {
    run_on_stream(this->machine_, build_of(mesh, options, tree), scratch, stream);
}

template <class Machine>
BuildMs LaunchedTrees<Machine>::time(const DeviceMesh& mesh, const OctreeOptions& options,
                                     const DeviceOctreeArrays& tree, Scratch scratch,
                                     Stream stream) {
    return time_on_stream(this->machine_, build_of(mesh, options, tree), scratch, stream);
}

}  // namespace raydix
