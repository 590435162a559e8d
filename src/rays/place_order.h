// Rays in the order of a Morton curve through their origins: neighbours in it are neighbours in
// space. rays [n] -> order [n]: positions in `rays`.
#pragma once

#include <raydix/buffer.h>
#include <raydix/types.h>

#include <cstdint>
#include <span>

namespace raydix {

/// 128 cells along the longest side of `bounds`; origins beyond it count as on its surface. Stable.
/// Fewer than 2^31 rays.
[[nodiscard]] Buffer<std::uint32_t> order_by_place(const Aabb& bounds, std::span<const Ray> rays);
/// The same for points.
[[nodiscard]] Buffer<std::uint32_t> order_by_place(const Aabb& bounds,
                                                   std::span<const Vec3> points);

}  // namespace raydix
