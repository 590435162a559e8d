// Scenes of instances as data, for tests that build them through more than one API.
#pragma once

#include <raydix/double.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace raydix::test {

/// An affine map by rows, as raydix::Transform has it.
using MapRows = std::array<std::array<double, 4>, 3>;

/// A mesh or a group, placed in a group.
struct Placed {
    bool group = false;
    std::size_t what = 0;
    MapRows rows{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    std::uint32_t mask = 0xFFFFFFFFu;
};

/// groups[0] is the scene; a group shows only groups behind it.
struct Layout {
    std::vector<MeshD> meshes;
    std::vector<std::vector<Placed>> groups{1};
    bool ray_masks = false;  // rays see by a mask of their own, not all
};

/// A mesh in the scene, and the way to it: places in the groups, from the scene inward. `number` is
/// contract.md's: paths counted from 1, depth first, every instance on the way counted.
struct ShownMesh {
    std::size_t mesh = 0;
    std::uint32_t number = 0;
    std::vector<std::uint32_t> path;
    std::vector<const Placed*> way;
};
std::vector<ShownMesh> shown_meshes(const Layout& layout);

/// Some triangles of each mesh shown, where they stand in the scene: what rays aim at.
MeshD some_triangles(const Layout& layout, std::size_t count);

/// "grid", "mirrored", "stretched", "sheared", "ties", "nested", "deep", "masks", "offset", and
/// "far": the grid at a place where floats have steps of half a metre. Made without any rounding
/// that machines do differently.
Layout layout_named(const std::string& name);

}  // namespace raydix::test
