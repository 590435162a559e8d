// What the workloads of `bench scene` are made of, the same for both sides and fixed by a seed:
// meshes and where they stand, spheres, discs, viewpoints, rays, queries.
#pragma once

#include <raydix/mesh.h>
#include <raydix/shapes.h>
#include <raydix/types.h>

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "cli/options.h"
#include "disc.h"

namespace raydix::bench {

/// Three rows of four numbers, from a thing's space to that of what it stands in.
using Affine = std::array<float, 12>;

/// A mesh, or a group of other placements, by number.
struct Placement {
    std::uint32_t thing = 0;
    bool is_group = false;
    Affine to_parent{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
};

/// groups[0] is the scene itself. Groups refer to groups behind them only.
struct PlacedScene {
    std::vector<std::shared_ptr<const Mesh>> meshes;
    std::vector<std::vector<Placement>> groups;
};

/// A mesh as it stands in the scene. Leaves are numbered depth first, in the order of placements.
struct PlacedLeaf {
    std::uint32_t mesh = 0;
    Affine to_world{};
};
[[nodiscard]] std::vector<PlacedLeaf> leaves_of(const PlacedScene& scene, std::uint32_t group = 0);
/// first[g][k]: how many leaves of group g stand before its placement k; the last is the sum.
[[nodiscard]] std::vector<std::vector<std::uint32_t>> first_leaves_of(const PlacedScene& scene);

[[nodiscard]] Aabb bounds_of(const Mesh& mesh);
[[nodiscard]] Aabb bounds_of(const PlacedScene& scene, std::uint32_t group = 0);

using SharedMesh = std::shared_ptr<const Mesh>;
/// Of a file or a built-in scene, whose name without folders it bears; its vertex array has room
/// for one more (Embree reads 16 bytes a vertex). Throws InputError.
[[nodiscard]] SharedMesh load_shared_mesh(const std::string& scene, std::uint64_t seed);
/// One plant of the built-in scene `grove`, its foot at 0.
[[nodiscard]] SharedMesh make_plant(std::uint64_t triangles, std::uint64_t seed);

/// `count` copies on a jittered grid, turned and scaled at random.
[[nodiscard]] PlacedScene make_instances(const SharedMesh& mesh, std::uint64_t count,
                                         std::uint64_t seed);
/// `count` copies on the ground, turned about y, so close that they overlap.
[[nodiscard]] PlacedScene make_plants(const SharedMesh& plant, std::uint64_t count,
                                      std::uint64_t seed);
/// A grid of grids of grids: about `count` leaves on three levels.
[[nodiscard]] PlacedScene make_nested(const SharedMesh& mesh, std::uint64_t count,
                                      std::uint64_t seed);
/// `count` meshes of their own, side by side.
[[nodiscard]] std::vector<SharedMesh> make_pieces(std::uint64_t count, std::uint64_t triangles,
                                                  std::uint64_t seed);
[[nodiscard]] SharedMesh merged(const std::vector<SharedMesh>& pieces);

/// Balls of mixed sizes in a cube, a few of them overlapping.
[[nodiscard]] std::vector<Sphere> make_spheres(std::uint64_t count, std::uint64_t seed);
/// Around the points of a cloud, half as large as points of a surface are apart on average.
[[nodiscard]] std::vector<Sphere> spheres_around(const std::vector<Vec3>& points);
[[nodiscard]] std::vector<Disc> make_discs(std::uint64_t count, std::uint64_t seed);

/// Rays of one kind: each launch is a batch.
struct RayKindOf {
    std::string name;  // primary or random
    std::vector<std::vector<Ray>> launches;
};
/// primary: two pictures, from outside of the box and from a place inside of it. random: as many
/// rays as a picture, from anywhere in the box in any direction.
[[nodiscard]] std::vector<RayKindOf> make_rays(const Aabb& box, cli::Size size, std::uint64_t seed);

}  // namespace raydix::bench
