#include "support/digest_inputs.h"

#include <raydix/model.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "support/double_scenes.h"
#include "support/support.h"

namespace raydix::test {

std::vector<RayD> digest_rays(const MeshD& mesh, std::size_t count, std::uint64_t seed) {
    std::vector<RayD> rays = mixed_rays(mesh, count, seed);
    const auto largest = [](Vec3d d) {
        return std::max({std::fabs(d.x), std::fabs(d.y), std::fabs(d.z)});
    };
    for (RayD& ray : rays) {
        while (largest(ray.direction) > 0x1p40) ray.direction = 0x1p-64 * ray.direction;
        while (largest(ray.direction) < 0x1p-40 && largest(ray.direction) > 0)
            ray.direction = 0x1p64 * ray.direction;
    }
    return rays;
}

std::vector<Ray> in_float(const std::vector<RayD>& rays) {
    const auto rounded = [](Vec3d p) {
        return Vec3{static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
    };
    std::vector<Ray> out;
    for (const RayD& ray : rays)
        out.push_back({rounded(ray.origin), static_cast<float>(ray.tmin), rounded(ray.direction),
                       static_cast<float>(ray.tmax)});
    return out;
}

namespace {

void write_ply(const std::filesystem::path& file, const Mesh& mesh) {
    std::ofstream out(file, std::ios::binary);
    out << "ply\nformat binary_little_endian 1.0\nelement vertex " << mesh.vertices.size()
        << "\nproperty float x\nproperty float y\nproperty float z\nelement face "
        << mesh.triangles.size() << "\nproperty list uchar uint vertex_indices\nend_header\n";
    out.write(reinterpret_cast<const char*>(mesh.vertices.data()),
              static_cast<std::streamsize>(mesh.vertices.size() * sizeof(Vec3)));
    for (const Triangle& triangle : mesh.triangles) {
        out.put(3);
        out.write(reinterpret_cast<const char*>(&triangle), sizeof triangle);
    }
    if (!out.flush()) throw std::runtime_error("cannot write " + file.string());
}

}  // namespace

Mesh small_builtin(const char* spec) {
    if (thorough > 1) return load_model(spec).mesh();
    std::string name = spec;
    std::ranges::replace_if(
        name, [](char c) { return std::isalnum(c) == 0; }, '-');
    const std::filesystem::path folder = built_file("builtin"), file = folder / (name + ".ply");
    if (!std::filesystem::exists(file)) {
        std::filesystem::create_directories(folder);
        const auto own = folder / (name + "." + std::to_string(getpid()));
        write_ply(own, load_model(spec).mesh());
        std::filesystem::rename(own, file);
    }
    return load_model(file.string()).mesh();
}

MeshD thinned(MeshD mesh, std::size_t step) {
    std::vector<Triangle> kept;
    for (std::size_t i = 0; i < mesh.triangles.size(); i += step) kept.push_back(mesh.triangles[i]);
    mesh.triangles = std::move(kept);
    return mesh;
}

MeshD across(const std::vector<AabbD>& boxes) {
    MeshD mesh;
    for (const AabbD& box : boxes) {
        const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.insert(mesh.vertices.end(), {box.lo, {box.hi.x, box.lo.y, box.hi.z}, box.hi});
        mesh.triangles.push_back({first, first + 1, first + 2});
    }
    return mesh;
}

}  // namespace raydix::test
