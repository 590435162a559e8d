// Once per batch, on the host.
#include "trace/warp/prepare_rays.h"

namespace raydix {

PreparedRays::PreparedRays(std::span<const Ray> rays) : rays_(rays.begin(), rays.end()) {
    for (std::size_t i = 0; i < rays_.size(); ++i) {
        const bool valid = is_valid(rays[i]);
        rays_[i] = prepared_ray(rays[i]);
        if (!valid) {
            ++invalid_;
            continue;
        }
        const float scale = t_scale_of(rays[i]);
        if (scale != 1.0f) scaled_.push_back({i, scale});
    }
}

void PreparedRays::rescale(std::span<TreeHit> hits) const {
    for (const Scale& scale : scaled_) hits[scale.ray].t *= scale.t_scale;
}

}  // namespace raydix
