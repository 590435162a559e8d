// What digests ask with: made of whole numbers and of sums, products, quotients and square roots,
// which every machine rounds alike. No sines, no powers: libraries differ in the last bits of
// these.
#pragma once

#include <raydix/double.h>
#include <raydix/types.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace raydix::test {

/// mixed_rays() with directions whose largest component is within 2^-40 to 2^40, so that they are
/// floats too.
std::vector<RayD> digest_rays(const MeshD& mesh, std::size_t count, std::uint64_t seed);

/// Rounded to float. A limit of 0 or infinity stays.
std::vector<Ray> in_float(const std::vector<RayD>& rays);

/// The built-in scene of a name that makes triangles, at its least size. Where that takes seconds,
/// under sanitizers and on an emulated processor, it is kept in the build folder for the next test.
Mesh small_builtin(const char* spec);

/// The triangles of a mesh that are left when all but every `step`-th go; all vertices stay.
MeshD thinned(MeshD mesh, std::size_t step);

/// One triangle across each box, from its lowest to its highest corner: for rays that aim at boxes.
MeshD across(const std::vector<AabbD>& boxes);

/// For each hit the ray again, once with tmax and once with tmin at the hit's t, which is still on
/// it. At most `most` hits are taken.
template <class AnyRay, class AnyHit>
void add_rays_to_hits(std::vector<AnyRay>& rays, const std::vector<AnyHit>& hits,
                      std::size_t most) {
    for (std::size_t i = 0, taken = 0; i < hits.size() && taken < most; ++i) {
        if (!hits[i].hit()) continue;
        ++taken;
        AnyRay until = rays[i], from = rays[i];
        until.tmax = hits[i].t;
        from.tmin = hits[i].t;
        rays.push_back(until);
        rays.push_back(from);
    }
}

}  // namespace raydix::test
