#include "rays/place_order.h"

#include <hwy/cache_control.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

#include "base/math.h"
#include "sort/radix_sort.h"

namespace raydix {
namespace {

constexpr int axis_bits = 7;
/// Bit k of a cell's number at 3 k.
constexpr auto spread = [] {
    std::array<std::uint32_t, std::size_t{1} << axis_bits> table{};
    for (std::uint32_t cell = 0; cell < table.size(); ++cell)
        for (int bit = 0; bit < axis_bits; ++bit) table[cell] |= (cell >> bit & 1) << 3 * bit;
    return table;
}();

/// place(i) of n elements.
template <class Place>
Buffer<std::uint32_t> order_along_curve(const Aabb& bounds, std::size_t n, const Place& place) {
    constexpr float last = (1 << axis_bits) - 1;
    const Vec3 size = bounds.hi - bounds.lo;
    const float longest = max_of(max_of(size.x, size.y), size.z);
    const float scale =
        longest > 0.0f ? min_of((last + 1) / longest, std::numeric_limits<float>::max()) : 0.0f;
    const auto bits = [&](float at, float lo) {  // NaN is in cell 0
        return spread[static_cast<std::uint32_t>(
            static_cast<std::int32_t>(min_of(max_of((at - lo) * scale, 0.0f), last)))];
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
                *keys++ = bits(o.x, bounds.lo.x) << 2 | bits(o.y, bounds.lo.y) << 1 |
                          bits(o.z, bounds.lo.z);
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
    return order_along_curve(bounds, rays.size(), [&](std::size_t i) {
        constexpr std::size_t ahead = 32;
        hwy::Prefetch(rays.data() + std::min(i + ahead, rays.size() - 1));
        return rays[i].origin;
    });
}

Buffer<std::uint32_t> order_by_place(const Aabb& bounds, std::span<const Vec3> points) {
    return order_along_curve(bounds, points.size(), [&](std::size_t i) { return points[i]; });
}

}  // namespace raydix
