// Public rays -> rays that the warp kernels take: valid ones with directions of ordinary length,
// and invalid ones that miss because tmin > tmax.
#pragma once

#include <raydix/types.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "base/atomic.h"
#include "base/hd.h"
#include "base/math.h"
#include "trace/ray_frame.h"

namespace raydix {

/// What to multiply t of a prepared ray's hit with, for it to be in units of the caller's
/// direction; `ray` must be valid. 1 for nearly all.
RAYDIX_HD static inline float t_scale_of(const Ray& ray) {
    const Vec3 d = ray.direction;
    return direction_scale(max_of(max_of(std::fabs(d.x), std::fabs(d.y)), std::fabs(d.z)));
}

RAYDIX_HD static inline Ray prepared_ray(Ray ray) {
    if (!is_valid(ray)) return Ray{{0, 0, 0}, 1.0f, {1, 0, 0}, 0.0f};
    ray.tmin = max_of(ray.tmin, 0.0f);
    const float scale = t_scale_of(ray);
    if (scale == 1.0f) return ray;
    ray.direction = ray.direction * scale;
    ray.tmin /= scale;
    ray.tmax = min_of(ray.tmax, std::numeric_limits<float>::max()) / scale;
    return ray;
}

/// Ray i of a launch on a device.
struct PrepareRay {
    const Ray* rays;         // [n]
    Ray* prepared;           // [n], out
    std::uint32_t* invalid;  // null, or [1]: invalid rays are added
    RAYDIX_HD void operator()(std::uint32_t i) const {
        const Ray ray = rays[i];
        if (invalid != nullptr && !is_valid(ray)) claim(*invalid, 1);
        prepared[i] = prepared_ray(ray);
    }
};

/// TreeHit i back to the caller's units.
struct RescaleHit {
    const Ray* rays;  // [n], the caller's
    TreeHit* hits;    // [n], in and out
    RAYDIX_HD void operator()(std::uint32_t i) const {
        const Ray ray = rays[i];
        if (!is_valid(ray)) return;
        const float scale = t_scale_of(ray);
        if (scale != 1.0f) hits[i].t *= scale;
    }
};

/// The same on the host, which remembers the few rays whose scale is not 1.
class PreparedRays {
public:
    explicit PreparedRays(std::span<const Ray> rays);

    [[nodiscard]] std::span<const Ray> rays() const { return rays_; }
    [[nodiscard]] std::uint64_t invalid() const { return invalid_; }
    /// t of `hits` back to the units of the caller's directions.
    void rescale(std::span<TreeHit> hits) const;

private:
    std::vector<Ray> rays_;
    struct Scale {
        std::size_t ray;
        float t_scale;
    };
    std::vector<Scale> scaled_;
    std::uint64_t invalid_ = 0;
};

}  // namespace raydix
