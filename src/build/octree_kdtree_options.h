// Options of k-d trees and octrees, checked and with their defaults filled in.
#pragma once

#include <raydix/kdtree.h>
#include <raydix/octree.h>

#include <cstdint>

namespace raydix {

/// Throws the InputError of build_kdtree.
[[nodiscard]] KdTreeOptions resolved(KdTreeOptions options, PrimitiveKind kind, std::uint64_t n);
/// Throws the InputError of build_octree.
[[nodiscard]] OctreeOptions resolved(OctreeOptions options, std::uint64_t n);
/// Throws InputError if a link could not name so many inner nodes.
void check_kd_inner(std::uint64_t inner, std::uint64_t primitives);

}  // namespace raydix
