#include "support/scenes.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "base/math.h"
#include "support/support.h"

namespace raydix::test {

std::vector<Model> builtin_triangle_scenes(std::size_t triangles) {
    std::vector<Model> scenes;
    for (const BuiltinScene& builtin : builtin_scenes()) {
        if (builtin.name == "lidar") continue;  // points; its triangles are those of the atrium
        for (const BuiltinParameter& parameter : builtin.parameters) {
            if (parameter.name != "triangles") continue;
            const auto count = std::max(static_cast<std::size_t>(parameter.min_value), triangles);
            scenes.push_back(load_model("builtin:" + std::string(builtin.name) +
                                        "?triangles=" + std::to_string(count)));
        }
    }
    return scenes;
}

Model load_thinned(const std::filesystem::path& file, std::size_t most_if_slow) {
    Model scene = load_model(file.string());
    std::vector<Triangle>& all = scene.mesh().triangles;
    const std::size_t step = thorough > 1 ? 1 : all.size() / most_if_slow + 1;
    for (std::size_t k = 0; k * step < all.size(); ++k) all[k] = all[k * step];
    all.resize((all.size() + step - 1) / step);
    return scene;
}

Model scene_of(Mesh mesh, std::string name) {
    Model scene;
    scene.name = std::move(name);
    scene.cameras.cameras.push_back(fit_camera(inspect(mesh).bounds));
    scene.mesh() = std::move(mesh);
    return scene;
}

Mesh lattice_mesh(std::size_t triangles, int side, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const auto coordinate = [&] {
        return static_cast<float>(random() % static_cast<unsigned>(side + 1));
    };
    Mesh mesh;
    for (std::uint32_t i = 0; i < 3 * triangles; ++i)
        mesh.vertices.push_back({coordinate(), coordinate(), coordinate()});
    for (std::size_t i = 0; i < triangles; ++i) {
        const auto corner = [&] {
            return static_cast<std::uint32_t>(random() % mesh.vertices.size());
        };
        mesh.triangles.push_back({corner(), corner(), corner()});
    }
    return mesh;
}

Mesh nested_triangles(int count) {
    Mesh mesh;
    for (int k = 0; k < count; ++k) {
        const float size = 1.0f + 0.01f * static_cast<float>(k);
        const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
        for (const Vec3& corner : {Vec3{0, 0, 0}, Vec3{size, 0, size}, Vec3{0, size, 0.3f * size}})
            mesh.vertices.push_back(corner);
        mesh.triangles.push_back({first, first + 1, first + 2});
    }
    return mesh;
}

Mesh ball_mesh(Vec3 middle) {
    Mesh mesh;
    constexpr int rows = 24;
    for (int i = 0; i <= rows; ++i)
        for (int j = 0; j < rows; ++j) {
            const float a = 3.14159265f * float(i) / rows, b = 6.2831853f * float(j) / rows;
            const bool pole = i == 0 || i == rows;
            const float r = pole ? 0.0f : std::sin(a);
            mesh.vertices.push_back(100.0f * Vec3{r * std::cos(b), r * std::sin(b), std::cos(a)} +
                                    middle);
        }
    for (std::uint32_t i = 0; i < rows; ++i)
        for (std::uint32_t j = 0; j < rows; ++j) {
            const std::uint32_t k = (j + 1) % rows, p = i * rows, q = p + rows;
            mesh.triangles.push_back({p + j, q + j, q + k});
            mesh.triangles.push_back({p + j, q + k, p + k});
        }
    return mesh;
}

Mesh moved(Mesh mesh, Vec3 by) {
    for (Vec3& p : mesh.vertices) p = p + by;
    return mesh;
}

Mesh scaled(Mesh mesh, float by) {
    for (Vec3& p : mesh.vertices) p = p * by;
    return mesh;
}

}  // namespace raydix::test
