// Scene `soup`: random triangles in the unit cube, sizes over three decades. Each owns its three
// vertices.
#include <cmath>

#include "exec/parallel.h"
#include "scene/builtin.h"
#include "scene/builtin_math.h"

namespace raydix::builtin {

BuiltinResult make_soup(std::uint64_t triangles, std::uint64_t seed) {
    BuiltinResult result;
    Mesh& mesh = result.mesh;
    mesh.vertices.resize(3 * triangles);
    mesh.triangles.resize(triangles);
    for_each_index(triangles, [&](std::size_t i) {
        Random random(seed, i);
        const Point center{random.unit(), random.unit(), random.unit()};
        const double largest = random.range(0.1, 0.2);
        const double size = std::ldexp(largest, -static_cast<int>(random.below(10)));
        for (std::size_t k = 0; k < 3; ++k) {
            const Point offset{random.sign(), random.sign(), random.sign()};
            mesh.vertices[3 * i + k] = to_vec3(center + offset * size);
        }
        const auto first = static_cast<std::uint32_t>(3 * i);
        mesh.triangles[i] = {first, first + 1, first + 2};
    });
    result.cameras.ao_radius = 0.1f;
    result.cameras.cameras = {camera("corner", {2.1f, 1.6f, 2.4f}, {0.5f, 0.5f, 0.5f}, 32.0f),
                              camera("inside", {0.5f, 0.5f, 0.5f}, {0.0f, 0.4f, 0.0f}, 70.0f)};
    return result;
}

}  // namespace raydix::builtin
