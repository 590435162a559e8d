// The k-d tree straight from its definition: the grid is halved again and again, serially and
// recursively. What the parallel builder makes is compared with it.
#pragma once

#include <raydix/kdtree.h>

#include <span>

namespace raydix::test {

/// Node numbers differ from the builder's; everything that kd_hash looks at must not.
KdTree reference_kdtree(const MeshView& mesh, const KdTreeOptions& options = {});

/// The k nearest by looking at every point, ordered by (d2, id). queries [n] -> [n * k]
std::vector<KdNeighbor> nearest_of_all(std::span<const Vec3> points, std::span<const Vec3> queries,
                                       std::uint32_t k);

}  // namespace raydix::test
