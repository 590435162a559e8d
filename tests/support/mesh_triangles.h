// The corners of a mesh's triangles, as queries and their references take them.
#pragma once

#include <raydix/bvh.h>
#include <raydix/mesh.h>

#include <cstddef>

namespace raydix::test {

template <class Real>
BasicLeafTriangle<Real> corners(const BasicMesh<Real>& mesh, std::size_t i) {
    const Triangle& t = mesh.triangles[i];
    return {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
}

}  // namespace raydix::test
