// Rays with long or short directions, as those to a lamp at t = 1, would go one by one. Copies that
// are scaled as make_frame scales them go in packets and streams; their hits are those of the rays,
// t in other units.
#pragma once

#include <raydix/types.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "base/math.h"
#include "trace/ray_frame.h"
#include "trace/simd/simd_kernels.h"

namespace raydix {

/// Of a valid ray.
inline float longest_of(const Ray& ray) {
    return max_of(max_of(std::fabs(ray.direction.x), std::fabs(ray.direction.y)),
                  std::fabs(ray.direction.z));
}

inline constexpr float nearly_unit_from = 0x1p-3f, nearly_unit_to = 0x1p3f;
/// Whether kernels take it as it is.
inline bool is_near_unit(float longest) {
    return longest > nearly_unit_from && longest < nearly_unit_to;
}

/// t of the ray is this times t of `copy`, whose frame is that of the ray. 1 and the ray itself
/// where kernels take it as it is, where it is invalid, or where no scale does.
inline float scaled_copy(const Ray& ray, Ray& copy) {
    copy = ray;
    const float longest = longest_of(ray);
    if (is_near_unit(longest) || !is_valid(ray)) return 1.0f;
    constexpr float most = std::numeric_limits<float>::max();
    const float scale = direction_scale(longest);
    const Ray scaled{ray.origin, start_in_units(ray.tmin, scale), ray.direction * scale,
                     min_of(min_of(ray.tmax, most) / scale, most)};
    if (!is_near_unit(longest_of(scaled)) || !(scaled.tmin <= scaled.tmax)) return 1.0f;
    copy = scaled;
    return scale;
}

/// The rays of a job as copies, and where their answers go first. Kept from job to job.
class ScaledJob {
public:
    /// The same job on copies, made by `scale`.
    SimdJob copied(const SimdJob& job, ScaleRays* scale) {
        rays_.resize(job.n + spare_scaled_rays);
        scales_.resize(job.n + spare_scaled_rays);
        scale(job.rays, job.order, job.n, rays_.data(), scales_.data());
        SimdJob out = job;
        out.rays = rays_.data();
        out.order = nullptr;
        if (job.order == nullptr) return out;  // answers have the places of the copies
        if (job.hits) {
            hits_.resize(job.n);
            out.hits = HitRows(hits_.data());
        } else {
            found_.resize(job.n);
            out.occluded = found_.data();
        }
        return out;
    }
    /// What the copies gave, to where the job wants it.
    void hand_over(const SimdJob& job) const {
        if (job.hits) {
            for (std::size_t k = 0; k < job.n; ++k) {
                TreeHit hit = job.order == nullptr ? *job.hits.at(k) : hits_[k];
                if (hit.hit()) hit.t *= scales_[k];
                if (job.order == nullptr)
                    job.hits.at(k)->t = hit.t;
                else
                    job.hits.put(job.order[k], hit);
            }
        } else if (job.order != nullptr) {
            for (std::size_t k = 0; k < job.n; ++k) job.occluded[job.order[k]] = found_[k];
        }
    }

private:
    std::vector<Ray> rays_;
    std::vector<float> scales_;
    std::vector<TreeHit> hits_;
    std::vector<std::uint8_t> found_;
};

}  // namespace raydix
