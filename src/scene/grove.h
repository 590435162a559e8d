// What the scene `grove` is made of. Metres, y up; the clearing lies around the origin.
#pragma once

#include <span>
#include <vector>

#include "scene/builtin_math.h"
#include "scene/patch_model.h"

namespace raydix::builtin {

inline constexpr double grove_half = 30.0;  // the terrain is a square of twice this

/// Height of the ground.
double ground(double x, double z, std::uint64_t seed);

struct Tree {
    Point foot;
    double height;
    std::uint64_t seed;
};
std::vector<Tree> plant_trees(std::uint64_t count, std::uint64_t seed);

/// Where leaves grow: a twig's place, its heading, and how far leaves reach from it.
struct Twig {
    Point at, heading;
    double reach;
};
/// Adds trunk and branches as patches and returns the tips.
std::vector<Twig> grow_tree(PatchModel& model, const Tree& tree, int levels);

/// Fills vertices [4 * n] and triangles [2 * n] with leaves: two triangles folded along the middle
/// rib.
void place_leaves(std::span<const Twig> twigs, double size, std::uint64_t seed,
                  std::span<Vec3> vertices, std::span<Triangle> triangles, std::uint32_t base);
/// Fills vertices [5 * n] and triangles [3 * n] with blades of grass.
void place_grass(double size, std::uint64_t seed, std::span<Vec3> vertices,
                 std::span<Triangle> triangles, std::uint32_t base);

}  // namespace raydix::builtin
