#include "support/support.h"

namespace raydix::test {

std::filesystem::path shared_scene(const std::string& name) {
    return std::filesystem::path(RAYDIX_SHARED_SCENES) / name;
}

std::filesystem::path source_file(const std::string& name) {
    return std::filesystem::path(RAYDIX_SOURCE_DIR) / name;
}

std::filesystem::path built_file(const std::string& name) {
    return std::filesystem::path(RAYDIX_BINARY_DIR) / name;
}

TempFolder::TempFolder() : TempPath("raydix-test-") { std::filesystem::create_directories(path()); }

Mesh random_soup(std::size_t count, std::uint64_t seed, float size) {
    std::mt19937_64 random(seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    Mesh mesh;
    mesh.name = "soup";
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 base{unit(), unit(), unit()};
        for (int k = 0; k < 3; ++k)
            mesh.vertices.push_back({base.x + size * (unit() - 0.5f),
                                     base.y + size * (unit() - 0.5f),
                                     base.z + size * (unit() - 0.5f)});
        const auto first = static_cast<std::uint32_t>(3 * i);
        mesh.triangles.push_back({first, first + 1, first + 2});
    }
    return mesh;
}

Mesh laced(Mesh mesh, std::size_t k) {
    for (std::size_t i = 0; i < mesh.vertices.size(); i += k)
        mesh.vertices[i].y = i % 2 == 0 ? std::nanf("") : infinity;
    return mesh;
}

}  // namespace raydix::test
