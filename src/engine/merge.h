// Meshes behind each other as one.
#pragma once

#include <raydix/error.h>
#include <raydix/mesh.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "exec/parallel.h"

namespace raydix {

/// In float or in double. `first`: takes the first triangle of each. Throws InputError: 2^32 - 1
/// triangles or vertices, or more.
template <class AnyMesh, class AnyView>
[[nodiscard]] AnyMesh merged(std::span<const AnyView> meshes, std::vector<std::uint32_t>& first) {
    std::size_t vertices = 0, triangles = 0;
    for (const AnyView& mesh : meshes) {
        first.push_back(static_cast<std::uint32_t>(triangles));
        vertices += mesh.vertices.size();
        triangles += mesh.triangles.size();
    }
    if (std::max(vertices, triangles) >= no_primitive)
        throw InputError("scene: " + std::to_string(triangles) + " triangles of " +
                         std::to_string(vertices) + " vertices are too many for one tree");
    AnyMesh out;
    out.vertices.resize(vertices);
    out.triangles.resize(triangles);
    std::size_t vertex = 0;
    for (std::size_t k = 0; k < meshes.size(); ++k) {
        const AnyView& mesh = meshes[k];
        std::copy(mesh.vertices.begin(), mesh.vertices.end(),
                  out.vertices.begin() + static_cast<std::ptrdiff_t>(vertex));
        const auto offset = static_cast<std::uint32_t>(vertex);
        for_each_index(mesh.triangles.size(), [&](std::size_t i) {
            const Triangle& t = mesh.triangles[i];
            out.triangles[first[k] + i] = {t[0] + offset, t[1] + offset, t[2] + offset};
        });
        vertex += mesh.vertices.size();
    }
    return out;
}

}  // namespace raydix
