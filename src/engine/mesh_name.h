// Meshes as the owner of a scene knows them.
#pragma once

#include <raydix/scene.h>

#include <cstdint>
#include <memory>

namespace raydix {

/// The triangles that hits name.
template <class Scalar>
struct BasicMeshName {
    std::uint32_t id, mask;
    BasicMeshView<Scalar> mesh;
    std::shared_ptr<const void> own;  // its arrays; null if they are the caller's
};
using MeshName = BasicMeshName<float>;
using MeshNameD = BasicMeshName<double>;

}  // namespace raydix
