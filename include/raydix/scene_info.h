// What a scene holds, counted as `inspect` counts a mesh.
#pragma once

#include <raydix/mesh.h>
#include <raydix/scene.h>

#include <cstdint>

namespace raydix {

/// Counts the triangles and vertices of a scene's last commit where its instances put them, each on
/// every path; shapes do not count. Vertices are moved as queries move them (scene_queries.h).
/// `bounds` are of the vertices, and exact. Throws InputError without a commit.
[[nodiscard]] MeshInfo inspect(const Scene& scene);
[[nodiscard]] MeshInfoD inspect(const SceneD& scene);

/// How many triangles the trees of the last commit leave out, of this scene and of those that stand
/// in it, each counted once. Takes no look at a triangle. Throws InputError without a commit.
[[nodiscard]] std::uint64_t left_out_triangles(const Scene& scene);
[[nodiscard]] std::uint64_t left_out_triangles(const SceneD& scene);

}  // namespace raydix
