// Triangles -> whether they close a body: edges are matched by the places of their ends.
#pragma once

#include <raydix/bvh.h>
#include <raydix/double.h>

#include <cstdint>
#include <span>

namespace raydix {

struct EdgeClosure {
    std::uint64_t odd = 0;         // edges that belong to an odd number of triangles
    std::uint64_t unbalanced = 0;  // edges run through more often one way than the other
};

/// Edges without length do not count. Coordinates must not be -0. Throws InputError for more
/// triangles than 32 bits have edges for.
[[nodiscard]] EdgeClosure match_edges(std::span<const LeafTriangle> triangles);
[[nodiscard]] EdgeClosure match_edges(std::span<const LeafTriangleD> triangles);

}  // namespace raydix
