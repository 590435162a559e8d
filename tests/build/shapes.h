// A small scene that looks different from every side: what the pictures and the secondary rays of
// the tests see.
#pragma once

#include <raydix/mesh.h>

#include <cmath>
#include <numbers>

namespace raydix::test {

inline void add_quad(Mesh& mesh, Vec3 a, Vec3 b, Vec3 c, Vec3 d) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), {a, b, c, d});
    mesh.triangles.push_back({first, first + 1, first + 2});
    mesh.triangles.push_back({first, first + 2, first + 3});
}

inline void add_box(Mesh& mesh, Vec3 lo, Vec3 hi) {
    const auto corner = [&](int i) {
        return Vec3{i & 1 ? hi.x : lo.x, i & 2 ? hi.y : lo.y, i & 4 ? hi.z : lo.z};
    };
    const int faces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                             {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    for (const auto& f : faces)
        add_quad(mesh, corner(f[0]), corner(f[1]), corner(f[2]), corner(f[3]));
}

inline void add_sphere(Mesh& mesh, Vec3 center, float radius, int rings) {
    const auto point = [&](int ring, int side) {
        const double down = std::numbers::pi * ring / rings,
                     around = std::numbers::pi * side / rings;
        return Vec3{center.x + radius * static_cast<float>(std::sin(down) * std::cos(around)),
                    center.y + radius * static_cast<float>(std::cos(down)),
                    center.z + radius * static_cast<float>(std::sin(down) * std::sin(around))};
    };
    for (int ring = 0; ring < rings; ++ring)
        for (int side = 0; side < 2 * rings; ++side)
            add_quad(mesh, point(ring, side), point(ring, side + 1), point(ring + 1, side + 1),
                     point(ring + 1, side));
}

/// A floor, a ball on its left, a tall and a low box on its right.
inline Mesh ball_and_boxes() {
    Mesh mesh;
    mesh.name = "ball and boxes";
    add_quad(mesh, {-4, 0, -4}, {-4, 0, 4}, {4, 0, 4}, {4, 0, -4});
    add_sphere(mesh, {-1.1f, 1.0f, 0.2f}, 1.0f, 16);
    add_box(mesh, {0.6f, 0.0f, -1.2f}, {1.5f, 2.4f, -0.3f});
    add_box(mesh, {0.9f, 0.0f, 0.5f}, {2.3f, 0.6f, 1.4f});
    return mesh;
}

}  // namespace raydix::test
