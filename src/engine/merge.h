// Meshes behind each other as one.
#pragma once

#include <raydix/error.h>
#include <raydix/mesh.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/grouped_meshes.h"
#include "exec/join_copies.h"

namespace raydix {

/// A mesh that stays where it is, among others.
template <class AnyView>
struct MergedCopy {
    AnyView mesh;
    std::uint64_t first_vertex, first_triangle;

    [[nodiscard]] static bool mirrors() { return false; }
    [[nodiscard]] static auto mover() {
        return [](const auto& vertex) { return vertex; };
    }
};

/// Throws InputError: 2^32 - 1 triangles or vertices, or more, which trees cannot count.
inline void require_countable(std::uint64_t triangles, std::uint64_t vertices) {
    if (std::max(vertices, triangles) >= no_primitive)
        throw InputError("scene: " + std::to_string(triangles) + " triangles of " +
                         std::to_string(vertices) + " vertices are too many for one tree");
}

/// In float or in double. `first`: takes the first triangle of each. Throws InputError as
/// require_countable() does.
template <class AnyMesh, class AnyView>
[[nodiscard]] AnyMesh merged(std::span<const AnyView> meshes, NumberAMesh& first) {
    std::vector<MergedCopy<AnyView>> copies;
    std::size_t vertices = 0, triangles = 0;
    for (const AnyView& mesh : meshes) {
        first.push_back(static_cast<std::uint32_t>(triangles));
        copies.push_back({mesh, vertices, triangles});
        vertices += mesh.vertices.size();
        triangles += mesh.triangles.size();
    }
    require_countable(triangles, vertices);
    AnyMesh out;
    join_copies(std::span<const MergedCopy<AnyView>>(copies), vertices, triangles, out);
    return out;
}

}  // namespace raydix
