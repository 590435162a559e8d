#include "support/digest_inputs.h"

#include <raydix/model.h>

#include <algorithm>
#include <cmath>

#include "support/double_scenes.h"

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

Mesh small_builtin(const char* spec) { return load_model(spec).mesh(); }

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
