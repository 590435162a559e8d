// The Karras tree straight from its definition: recursive, serial, slow and short. What the
// parallel builders make is compared with it.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>
#include <span>

namespace raydix::test {

/// Node numbers differ from a builder's; everything that tree_hash and check_same look at must not.
Bvh reference_tree(const MeshView& mesh, const BuildOptions& options = {});
Bvh reference_tree(std::span<const Aabb> boxes, const BuildOptions& options = {});
Bvh reference_tree(std::span<const Vec3> points, const BuildOptions& options = {});

/// contract.md 2: the Morton code of a box's centre in the scene box, `bits` 30 or 63.
std::uint64_t reference_code(const Aabb& box, const Aabb& scene, int bits);

}  // namespace raydix::test
