// Public rays -> rays that the warp kernels take: valid ones with directions of ordinary length,
// and invalid ones that miss because tmin > tmax.
#pragma once

#include <raydix/types.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace raydix {

class PreparedRays {
public:
    explicit PreparedRays(std::span<const Ray> rays);

    [[nodiscard]] std::span<const Ray> rays() const { return rays_; }
    [[nodiscard]] std::uint64_t invalid() const { return invalid_; }
    /// t of `hits` back to the units of the caller's directions.
    void rescale(std::span<Hit> hits) const;

private:
    std::vector<Ray> rays_;
    struct Scale {
        std::size_t ray;
        float t_scale;
    };
    std::vector<Scale> scaled_;  // the few whose direction is far from unit length
    std::uint64_t invalid_ = 0;
};

}  // namespace raydix
