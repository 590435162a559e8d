// Once per batch, on the host.
#include "trace/warp/prepare_rays.h"

#include <cmath>

#include "base/math.h"
#include "trace/ray_frame.h"

namespace raydix {

PreparedRays::PreparedRays(std::span<const Ray> rays) : rays_(rays.begin(), rays.end()) {
    for (std::size_t i = 0; i < rays_.size(); ++i) {
        Ray& ray = rays_[i];
        if (!is_valid(ray)) {
            ray = Ray{{0, 0, 0}, 1.0f, {1, 0, 0}, 0.0f};
            ++invalid_;
            continue;
        }
        ray.tmin = max_of(ray.tmin, 0.0f);
        const Vec3 d = ray.direction;
        const float scale =
            direction_scale(max_of(max_of(std::fabs(d.x), std::fabs(d.y)), std::fabs(d.z)));
        if (scale == 1.0f) continue;
        ray.direction = ray.direction * scale;
        ray.tmin /= scale;
        ray.tmax /= scale;
        scaled_.push_back({i, scale});
    }
}

void PreparedRays::rescale(std::span<Hit> hits) const {
    for (const Scale& scale : scaled_) hits[scale.ray].t *= scale.t_scale;
}

}  // namespace raydix
