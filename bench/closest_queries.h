// Queries for the closest point of a mesh: near its surface, and around it.
#pragma once

#include <raydix/mesh.h>

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "base/math.h"

namespace raydix::bench {

inline float unit_number(std::mt19937_64& random) {
    return static_cast<float>(random() >> 40) * 0x1p-24f;
}

/// About a hundredth of the diagonal off points of the surface.
inline std::vector<Vec3> near_queries(const Mesh& mesh, const Aabb& box, std::size_t n,
                                      std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const Vec3 size = box.hi - box.lo;
    const float reach = 0.01f * std::sqrt(dot(size, size));
    std::vector<Vec3> queries(n);
    for (Vec3& query : queries) {
        const Triangle& t = mesh.triangles[random() % mesh.triangles.size()];
        const float x = unit_number(random), y = unit_number(random);
        const Vec3 off{x - 0.5f, y - 0.5f, unit_number(random) - 0.5f};
        query = mesh.vertices[t[0]] + 2 * reach * off;
    }
    return queries;
}

/// In a box `scale` times as large as the mesh's, about the same center.
inline std::vector<Vec3> queries_around(const Aabb& box, std::size_t n, float scale,
                                        std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const Vec3 size = box.hi - box.lo, center = 0.5f * (box.lo + box.hi);
    std::vector<Vec3> queries(n);
    for (Vec3& query : queries) {
        const float x = unit_number(random) - 0.5f, y = unit_number(random) - 0.5f,
                    z = unit_number(random) - 0.5f;
        query = center + scale * Vec3{x * size.x, y * size.y, z * size.z};
    }
    return queries;
}

}  // namespace raydix::bench
