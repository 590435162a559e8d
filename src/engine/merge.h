// Meshes behind each other as one.
#pragma once

#include <raydix/mesh.h>

#include <cstdint>
#include <span>
#include <vector>

namespace raydix {

/// `first`: takes the first triangle of each. Throws InputError: 2^32 - 1 triangles or vertices, or
/// more.
[[nodiscard]] Mesh merged(std::span<const MeshView> meshes, std::vector<std::uint32_t>& first);

}  // namespace raydix
