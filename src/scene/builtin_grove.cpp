// Scene `grove`: a clearing among trees. A sixth of the triangles is ground, rocks and wood, a
// sixth grass, the rest leaves; larger requests have more trees with more and smaller leaves.
#include <algorithm>
#include <cmath>

#include "scene/builtin.h"
#include "scene/grove.h"

namespace raydix::builtin {

namespace {

/// Boulders, half sunk into the ground.
void add_rocks(PatchModel& model, std::uint64_t seed) {
    Random random(seed, 21);
    for (int i = 0; i < 14; ++i) {
        const Circle way = circle(random.unit());
        const double far = random.range(4.0, 0.8 * grove_half), size = random.range(0.3, 1.1);
        const double x = far * way.cos, z = far * way.sin;
        const Point center{x, ground(x, z, seed), z};
        const std::uint64_t shape = random.bits();
        model.add_patch(
            [=](double u, double v) {
                const Circle around = circle(u), up = circle(mix(-0.24, 0.24, v));
                const Point out{up.cos * around.cos, 0.7 * up.sin, -up.cos * around.sin};
                return center + out * (size * (1.0 + 0.4 * layered_noise(out * 1.5, 4, shape)));
            },
            {6, 12.0 * size}, {4, 7.0 * size});
    }
}

void add_ground(PatchModel& model, std::uint64_t seed) {
    model.add_patch(
        [seed](double u, double v) {
            const double x = grove_half * (2.0 * v - 1.0), z = grove_half * (2.0 * u - 1.0);
            return Point{x, ground(x, z, seed), z};
        },
        {20, 72.0}, {20, 72.0});
}

/// Cameras stand on the ground, wherever the seed puts it.
Vec3 above_ground(double x, double height, double z, std::uint64_t seed) {
    return to_vec3({x, ground(x, z, seed) + height, z});
}

CameraSet grove_cameras(std::uint64_t seed) {
    CameraSet set;
    set.ao_radius = 2.0f;
    const auto at = [seed](double x, double height, double z) {
        return above_ground(x, height, z, seed);
    };
    set.cameras = {
        camera("clearing", at(-4.5, 1.7, 3.5), at(8.0, 4.0, -6.0), 65.0f),
        camera("canopy", at(3.0, 1.2, 2.0), at(6.0, 12.0, 9.0), 70.0f),
        camera("edge", at(-29.0, 2.2, -24.0), at(0.0, 4.5, 0.0), 60.0f),
        camera("above", at(34.0, 24.0, 38.0), at(0.0, 1.0, -2.0), 48.0f),
        camera("grass", at(4.0, 0.45, -4.0), at(-3.0, 0.9, 3.0), 60.0f),
    };
    return set;
}

}  // namespace

double ground(double x, double z, std::uint64_t seed) {
    const double hills = 1.6 * layered_noise({0.06 * x, 0.3, 0.06 * z}, 2, seed);
    return hills + 0.12 * layered_noise({0.7 * x, 0.7, 0.7 * z}, 2, seed + 3);
}

BuiltinResult make_grove(std::uint64_t triangles, std::uint64_t seed) {
    const auto wanted = static_cast<double>(triangles);
    // Between 6 trees for ten thousand triangles and 110 for ten million.
    const auto trees =
        static_cast<std::uint64_t>(std::clamp(0.042 * std::sqrt(wanted) + 2.0, 6.0, 120.0));
    const int levels = triangles < 60'000 ? 2 : (triangles < 600'000 ? 3 : 4);
    PatchModel model(triangles < 30'000 ? 0.7 : 1.0);
    add_ground(model, seed);
    add_rocks(model, seed);
    std::vector<Twig> twigs;
    for (const Tree& tree : plant_trees(trees, seed)) {
        const std::vector<Twig> tips = grow_tree(model, tree, levels);
        twigs.insert(twigs.end(), tips.begin(), tips.end());
    }

    BuiltinResult result{model.tessellate(triangles / 6), grove_cameras(seed)};
    Mesh& mesh = result.mesh;
    const std::uint64_t rest =
        triangles - std::min<std::uint64_t>(triangles, mesh.triangles.size());
    const std::uint64_t blades = rest / 5 / 3, leaves = (rest - 3 * blades) / 2;
    const std::size_t wood = mesh.triangles.size(), wood_vertices = mesh.vertices.size();
    mesh.triangles.resize(wood + 3 * blades + 2 * leaves);
    mesh.vertices.resize(wood_vertices + 5 * blades + 4 * leaves);
    const std::span<Triangle> more(mesh.triangles.data() + wood, 3 * blades + 2 * leaves);
    const std::span<Vec3> corners(mesh.vertices.data() + wood_vertices, 5 * blades + 4 * leaves);
    const auto base = static_cast<std::uint32_t>(wood_vertices);

    // Leaves shrink slower than they multiply: the more there are, the more they overlap.
    const double crowd =
        std::sqrt(std::sqrt(static_cast<double>(leaves) / static_cast<double>(trees)));
    place_grass(0.42, seed, corners.first(5 * blades), more.first(3 * blades), base);
    place_leaves(twigs, std::clamp(2.4 / crowd, 0.06, 0.7), seed, corners.subspan(5 * blades),
                 more.subspan(3 * blades), base + static_cast<std::uint32_t>(5 * blades));
    return result;
}

}  // namespace raydix::builtin
