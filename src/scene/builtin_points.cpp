// Scenes `uniform` and `clustered`: point clouds in and around the unit cube.
#include <cmath>

#include "exec/parallel.h"
#include "scene/builtin.h"
#include "scene/builtin_math.h"

namespace raydix::builtin {

namespace {

CameraSet cube_cameras() {
    CameraSet set;
    set.cameras = {camera("corner", {2.1f, 1.6f, 2.4f}, {0.5f, 0.5f, 0.5f}, 32.0f)};
    return set;
}

/// Bell-shaped around 0 with deviation 1, never beyond 3.5.
double bell(Random& random) {
    double sum = -2.0;
    for (int i = 0; i < 4; ++i) sum += random.unit();
    return sum * 1.7320508;
}

}  // namespace

BuiltinResult make_uniform(std::uint64_t points, std::uint64_t seed) {
    BuiltinResult result{{}, cube_cameras()};
    result.mesh.vertices.resize(points);
    for_each_index(points, [&](std::size_t i) {
        Random random(seed, i);
        result.mesh.vertices[i] = to_vec3({random.unit(), random.unit(), random.unit()});
    });
    return result;
}

BuiltinResult make_clustered(std::uint64_t points, std::uint64_t clusters, std::uint64_t seed) {
    BuiltinResult result{{}, cube_cameras()};
    result.mesh.vertices.resize(points);
    for_each_index(points, [&](std::size_t i) {
        Random random(seed, i);
        Random cluster(seed + 1, random.below(clusters));
        const Point center{cluster.unit(), cluster.unit(), cluster.unit()};
        // From a sixteenth of the cube down to 2^-19 of it: the densest hold points that are equal
        // in float.
        const double size = std::ldexp(1.0, -4 - static_cast<int>(cluster.below(16)));
        const Point offset{bell(random), bell(random), bell(random)};
        result.mesh.vertices[i] = to_vec3(center + offset * size);
    });
    return result;
}

}  // namespace raydix::builtin
