#include "rays/place_order.h"

#include <limits>

#include "base/math.h"
#include "keys/morton.h"
#include "sort/radix_sort.h"

namespace raydix {
namespace {

/// place(i) of n elements.
template <class Place>
Buffer<std::uint32_t> order_along_curve(const Aabb& bounds, std::size_t n, const Place& place) {
    constexpr int axis_bits = 7;
    constexpr float last = (1 << axis_bits) - 1;
    const Vec3 size = bounds.hi - bounds.lo;
    const float longest = max_of(max_of(size.x, size.y), size.z);
    const float scale =
        longest > 0.0f ? min_of((last + 1) / longest, std::numeric_limits<float>::max()) : 0.0f;
    const auto cell = [&](float at, float lo) {  // NaN is in cell 0
        return static_cast<std::uint32_t>(min_of(max_of((at - lo) * scale, 0.0f), last));
    };
    // Memory that is filled with zeros or touched first by one thread costs many threads as much as
    // the sort.
    Buffer<std::uint32_t> order(n);
    SortScratch<std::uint32_t> scratch;
    sort_on_the_way<std::uint32_t>(
        n, 3 * axis_bits,
        [&](std::size_t begin, std::size_t end, std::uint32_t* keys) {
            for (std::size_t i = begin; i < end; ++i) {
                const Vec3 o = place(i);
                *keys++ = spread_bits(cell(o.x, bounds.lo.x)) << 2 |
                          spread_bits(cell(o.y, bounds.lo.y)) << 1 |
                          spread_bits(cell(o.z, bounds.lo.z));
            }
        },
        [&](std::size_t begin, std::span<const SortRecord<std::uint32_t>> sorted) {
            for (std::size_t k = 0; k < sorted.size(); ++k) order[begin + k] = sorted[k].position;
        },
        scratch);
    return order;
}

}  // namespace

Buffer<std::uint32_t> order_by_place(const Aabb& bounds, std::span<const Ray> rays) {
    return order_along_curve(bounds, rays.size(), [&](std::size_t i) { return rays[i].origin; });
}

Buffer<std::uint32_t> order_by_place(const Aabb& bounds, std::span<const Vec3> points) {
    return order_along_curve(bounds, points.size(), [&](std::size_t i) { return points[i]; });
}

}  // namespace raydix
