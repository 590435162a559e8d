// Rays that are hard for a tracer: through corners and edges, along axes and planes, from surfaces,
// from far away, with tiny directions, with limits that are the t of a hit.
#pragma once

#include <raydix/mesh.h>
#include <raydix/types.h>

#include <span>
#include <vector>

#include "attack/random.h"

namespace raydix::attack {

/// `count` rays around and at the mesh, a few of them invalid.
std::vector<Ray> make_rays(Random& random, const Mesh& mesh, std::size_t count);
/// From up to the largest float away, and with directions down to the least one. Spheres, capsules
/// and points may be missed by these.
std::vector<Ray> make_extreme_rays(Random& random, const Mesh& mesh, std::size_t count);
/// For each hit of `rays`: the ray with tmax, tmin, both, or the floats next to them at the hit's
/// t.
std::vector<Ray> tightened(Random& random, std::span<const Ray> rays, std::span<const Hit> hits,
                           std::size_t most);
/// A point on, near or far from the mesh.
Vec3 make_point(Random& random, const Mesh& mesh, const Aabb& bounds);
RayD to_double(const Ray& ray);

}  // namespace raydix::attack
