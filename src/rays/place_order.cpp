#include "rays/place_order.h"

#include <limits>

#include "base/math.h"
#include "exec/parallel.h"
#include "keys/morton.h"
#include "sort/radix_sort.h"

namespace raydix {
namespace {

/// place(i) of n elements.
template <class Place>
std::vector<std::uint32_t> order_along_curve(const Aabb& bounds, std::size_t n,
                                             const Place& place) {
    constexpr int axis_bits = 7;
    constexpr float last = (1 << axis_bits) - 1;
    const Vec3 size = bounds.hi - bounds.lo;
    const float longest = max_of(max_of(size.x, size.y), size.z);
    const float scale =
        longest > 0.0f ? min_of((last + 1) / longest, std::numeric_limits<float>::max()) : 0.0f;
    const auto cell = [&](float at, float lo) {  // NaN is in cell 0
        return static_cast<std::uint32_t>(min_of(max_of((at - lo) * scale, 0.0f), last));
    };
    std::vector<std::uint32_t> keys(n), order(n);
    for_each_index(n, [&](std::size_t i) {
        const Vec3 o = place(i);
        keys[i] = spread_bits(cell(o.x, bounds.lo.x)) << 2 |
                  spread_bits(cell(o.y, bounds.lo.y)) << 1 | spread_bits(cell(o.z, bounds.lo.z));
    });
    SortScratch<std::uint32_t> scratch;
    sort_keys<std::uint32_t>(keys, order, 3 * axis_bits, scratch);
    return order;
}

}  // namespace

std::vector<std::uint32_t> order_by_place(const Aabb& bounds, std::span<const Ray> rays) {
    return order_along_curve(bounds, rays.size(), [&](std::size_t i) { return rays[i].origin; });
}

std::vector<std::uint32_t> order_by_place(const Aabb& bounds, std::span<const Vec3> points) {
    return order_along_curve(bounds, points.size(), [&](std::size_t i) { return points[i]; });
}

}  // namespace raydix
