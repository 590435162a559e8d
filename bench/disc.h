// The geometry of the user's own in `bench scene`: round discs, and the C function that both sides
// call.
#pragma once

#include <raydix/types.h>

#include <cstdint>

namespace raydix::bench {

struct Disc {
    Vec3 center, normal;  // the normal has length 1
    float radius;
};
[[nodiscard]] Aabb box_of(const Disc& disc);

extern "C" {
/// Whether origin + t * direction is on disc `prim` for a t in [tmin, tmax]; if so, stores t.
int raydix_bench_hit_disc(const Disc* discs, std::uint32_t prim, const float* origin,
                          const float* direction, float tmin, float tmax, float* t);
}

}  // namespace raydix::bench
