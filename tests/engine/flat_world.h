// Random scenes as one mesh, by a walk of its own: what queries that see all triangles are held
// against.
#pragma once

#include <raydix/scene_pairs.h>

#include <cstdint>
#include <utility>
#include <vector>

#include "engine/float_world.h"

namespace raydix::test {

struct FlatWorld {
    Mesh mesh;
    std::vector<ScenePrimitive> names;  // [triangles]
};

inline bool mirrors(const Transform& t) {
    const auto& m = t.m;
    const auto d = [](float x) { return double{x}; };
    return d(m[0][0]) * (d(m[1][1]) * d(m[2][2]) - d(m[1][2]) * d(m[2][1])) -
               d(m[0][1]) * (d(m[1][0]) * d(m[2][2]) - d(m[1][2]) * d(m[2][0])) +
               d(m[0][2]) * (d(m[1][0]) * d(m[2][1]) - d(m[1][1]) * d(m[2][0])) <
           0;
}

/// Through all transforms in double, the last one first; then as floats.
inline Vec3 out_of(const std::vector<Transform>& way, Vec3 p) {
    double x = p.x, y = p.y, z = p.z;
    for (auto t = way.rbegin(); t != way.rend(); ++t) {
        const auto row = [&](std::size_t r) {
            return ((x * t->m[r][0] + y * t->m[r][1]) + z * t->m[r][2]) + t->m[r][3];
        };
        const double nx = row(0), ny = row(1), nz = row(2);
        x = nx, y = ny, z = nz;
    }
    return {static_cast<float>(x) + 0.0f, static_cast<float>(y) + 0.0f,
            static_cast<float>(z) + 0.0f};
}

/// `number`: of the path that leads here, through `way`, the outermost transform first.
inline void add_flat(const World& world, std::uint32_t mask, std::uint32_t number,
                     std::vector<Transform>& way, FlatWorld& out) {
    bool turned = false;
    for (const Transform& t : way) turned ^= mirrors(t);
    for (const World::Item& item : world.items) {
        if (item.inside || (item.mask & mask) == 0) continue;
        const auto first = static_cast<std::uint32_t>(out.mesh.vertices.size());
        for (const Vec3 p : item.mesh.vertices)
            out.mesh.vertices.push_back(way.empty() ? p : out_of(way, p));
        for (std::uint32_t i = 0; i < item.mesh.triangles.size(); ++i) {
            Triangle t = item.mesh.triangles[i];
            if (turned) std::swap(t[1], t[2]);
            out.mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
            out.names.push_back({number, item.id, i});
        }
    }
    std::uint32_t next = number + 1;
    for (const World::Item& item : world.items) {
        if (!item.inside) continue;
        way.push_back(item.transform);
        if ((item.mask & mask) != 0) add_flat(*item.inside, mask, next, way, out);
        way.pop_back();
        next += 1 + static_cast<std::uint32_t>(item.inside->paths());
    }
}

inline FlatWorld flat_of(const World& world, std::uint32_t mask = every_mask) {
    FlatWorld out;
    std::vector<Transform> way;
    add_flat(world, mask, 0, way, out);
    return out;
}

}  // namespace raydix::test
