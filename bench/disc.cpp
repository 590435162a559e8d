#include "disc.h"

#include <cmath>

#include "base/math.h"

namespace raydix::bench {

Aabb box_of(const Disc& disc) {
    // Larger than the disc by much more than the rounding of a point on it.
    const auto reach = [&](float n) {
        return disc.radius * std::sqrt(max_of(0.0f, 1.0f - n * n)) + 0x1p-14f * disc.radius;
    };
    const Vec3 half{reach(disc.normal.x), reach(disc.normal.y), reach(disc.normal.z)};
    return {disc.center - half, disc.center + half};
}

int raydix_bench_hit_disc(const Disc* discs, std::uint32_t prim, const float* origin,
                          const float* direction, float tmin, float tmax, float* t) {
    const Disc& disc = discs[prim];
    const Vec3 to{disc.center.x - origin[0], disc.center.y - origin[1], disc.center.z - origin[2]};
    const Vec3 d{direction[0], direction[1], direction[2]};
    const float at = dot(to, disc.normal) / dot(d, disc.normal);
    if (!(at >= tmin && at <= tmax)) return 0;
    const Vec3 off{at * d.x - to.x, at * d.y - to.y, at * d.z - to.z};
    if (!(dot(off, off) <= disc.radius * disc.radius)) return 0;
    *t = at;
    return 1;
}

}  // namespace raydix::bench
