// Scenes that hits and watertightness are tried on.
#pragma once

#include <raydix/model.h>

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace raydix::test {

/// One small version of each built-in scene of triangles.
std::vector<Model> builtin_triangle_scenes(std::size_t triangles);

/// The model of a file. Under sanitizers and on an emulated processor, where trees over millions of
/// triangles take minutes, every n-th triangle of it, at most `most_if_slow`.
Model load_thinned(const std::filesystem::path& file, std::size_t most_if_slow);

/// A mesh without a file gets its name and one camera that sees it.
Model scene_of(Mesh mesh, std::string name);

/// Triangles on a small lattice of integers: ties, shared edges, coplanar ones, zero areas.
Mesh lattice_mesh(std::size_t triangles, int side, std::uint64_t seed);

/// Each is larger than the one before by a hundredth of the first, and lies around it. Builders
/// that join what is near make a chain of them.
Mesh nested_triangles(int count);

/// A closed surface around `middle`, 100 from it, with many edges and two poles.
Mesh ball_mesh(Vec3 middle);

/// Every corner moved or scaled, rounded to float.
Mesh moved(Mesh mesh, Vec3 by);
Mesh scaled(Mesh mesh, float by);

}  // namespace raydix::test
