// The order of secondary rays: by a 6-D Morton key of origin and direction, or shuffled. rays [n]
// -> rays [n].
#pragma once

#include <raydix/types.h>

#include <compare>
#include <cstdint>
#include <span>
#include <vector>

namespace raydix {

/// 135 bits in three words. Each level holds one bit of every number, the highest level first, and
/// inside a level the order is origin x y z, direction x y z. Levels 23..21 exist for the origin
/// only.
struct RayKey {
    std::uint64_t high = 0;    // levels 23..14: 9 + 42 bits
    std::uint64_t middle = 0;  // levels 13..4: 60 bits
    std::uint32_t low = 0;     // levels 3..0: 24 bits

    auto operator<=>(const RayKey&) const = default;
};

/// The box of all end points: origin + tmin * direction and origin + tmax * direction, where
/// finite. Rays whose tmax is infinite end at `far`.
[[nodiscard]] Aabb end_point_box(std::span<const Ray> rays, float far);

/// Origin: floor((o - lo) / (hi - lo) * 2^24) per axis, clamped to [0, 2^24 - 1]; an axis without
/// extent gives 0. Direction: floor((d / |d| * 0.5 + 0.5) * 2^21) per axis, clamped to [0, 2^21 -
/// 1].
[[nodiscard]] RayKey ray_key(const Ray& ray, const Aabb& box);

/// Sorts by (ray_key in the rays' own end-point box, position). The farther the rays reach beyond
/// their origins, the fewer levels of the key are spent on origins before directions come in.
void sort_rays(std::vector<Ray>& rays, float far);

/// Puts the rays in the order of (hash_of(seed, position), position): a permutation that looks
/// random.
void shuffle_rays(std::vector<Ray>& rays, std::uint64_t seed);

}  // namespace raydix
