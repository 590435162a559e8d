// Where a ray enters the box of a rank: a lower bound of t for every hit inside. The proof is that
// of trace/slab.h; here all is computed in double, and pads are wider than they need to be, since
// boxes of ranks are few.
#pragma once

#include <raydix/types.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "mpi/rank_tree.h"
#include "trace/ray_frame.h"

namespace raydix::mpi {

inline RayD widened(const Ray& ray) {
    return {{ray.origin.x, ray.origin.y, ray.origin.z},
            ray.tmin,
            {ray.direction.x, ray.direction.y, ray.direction.z},
            ray.tmax};
}
inline const RayD& widened(const RayD& ray) { return ray; }

template <class T>
class RayReach {
public:
    /// `ray` must be valid; `whole` is around all boxes. `error`: the greatest of the extents in
    /// them (engine/extent.h), of shapes and instances.
    template <class AnyRay>
    RayReach(const AnyRay& ray, const RankBox<T>& whole, double error)
        : frame_(make_frame(widened(ray))) {
        const double origin[3] = {frame_.origin.x, frame_.origin.y, frame_.origin.z};
        double far[3];
        for (int d = 0; d < 3; ++d) {
            origin_[d] = origin[d];
            far[d] = std::max(std::fabs(double(whole.lo[d]) - origin[d]),
                              std::fabs(double(whole.hi[d]) - origin[d]));
        }
        // The point of a hit is within 12 roundings of a float from the ray, or 45 of a double.
        constexpr double roundings = sizeof(T) == 4 ? 32 * 0x1p-24 : 256 * 0x1p-53;
        const double beside = 1.0625 * error * std::max({far[0], far[1], far[2]});
        for (int d = 0; d < 3; ++d)
            pad_[d] = roundings * (far[d] + far[frame_.kz]) + beside + 0x1p-120;
        inverse_[0] = frame_.inverse.x;
        inverse_[1] = frame_.inverse.y;
        inverse_[2] = frame_.inverse.z;
    }

    /// NaN if the ray does not reach the box.
    [[nodiscard]] T operator()(const RankBox<T>& box) const {
        double entry = frame_.tmin, leave = std::numeric_limits<double>::infinity();
        for (int d = 0; d < 3; ++d) {
            double near = (double(box.lo[d]) - origin_[d] - pad_[d]) * inverse_[d];
            double far = (double(box.hi[d]) - origin_[d] + pad_[d]) * inverse_[d];
            if (std::signbit(inverse_[d])) std::swap(near, far);
            if (near > entry) entry = near;  // 0 * Inf, NaN: the ray is inside this slab
            if (far < leave) leave = far;
        }
        if (entry > leave * (1 + 0x1p-40)) return std::numeric_limits<T>::quiet_NaN();
        const double t = entry * frame_.t_scale;
        const T rounded = static_cast<T>(std::min(t, double(std::numeric_limits<T>::max())));
        // Rounded up, it would no longer be a lower bound.
        return double(rounded) > t ? std::nextafter(rounded, T(0)) : rounded;
    }

private:
    RayFrameD frame_;
    double origin_[3], inverse_[3], pad_[3];
};

}  // namespace raydix::mpi
