// Keys in parallel, then a merge sort over fixed blocks: (key, position) is unique, so there is one
// right order.
#include "rays/ray_order.h"

#include <algorithm>

#include "base/double3.h"
#include "base/math.h"
#include "exec/parallel.h"
#include "rays/sampling.h"

namespace raydix {
namespace {

constexpr std::size_t block_size = std::size_t{1} << 15;
constexpr int origin_bits = 24, direction_bits = 21;

template <class Key>
struct KeyedRay {
    Key key;
    std::uint32_t position;

    auto operator<=>(const KeyedRay&) const = default;
};

/// floor(part * 2^bits) clamped to the range of `bits`; NaN gives 0.
std::uint32_t cell_of(double part, int bits) {
    const double scaled = std::ldexp(part, bits), last = std::ldexp(1.0, bits) - 1.0;
    return scaled > 0.0 ? static_cast<std::uint32_t>(std::min(scaled, last)) : 0u;
}

double part_of_extent(float value, float lo, float hi) {
    return hi > lo ? (double(value) - lo) / (double(hi) - lo) : 0.0;
}

std::uint64_t level_bits(const std::uint32_t (&cells)[6], int level, int count) {
    std::uint64_t bits = 0;
    for (int k = 0; k < count; ++k) bits = bits << 1 | (cells[k] >> level & 1u);
    return bits;
}

/// Sorts blocks of fixed size, then merges neighbours in rounds.
template <class Entry>
void sort_entries(std::vector<Entry>& entries) {
    const std::size_t n = entries.size();
    for_each_block(n, block_size, [&](std::size_t, std::size_t begin, std::size_t end) {
        std::sort(entries.data() + begin, entries.data() + end);
    });
    std::vector<Entry> merged(n > block_size ? n : 0);
    for (std::size_t sorted = block_size; sorted < n; sorted *= 2) {
        for_each_block(n, 2 * sorted, [&](std::size_t, std::size_t begin, std::size_t end) {
            const Entry* first = entries.data() + begin;
            const Entry* middle = entries.data() + std::min(begin + sorted, end);
            const Entry* last = entries.data() + end;
            std::merge(first, middle, middle, last, merged.data() + begin);
        });
        entries.swap(merged);
    }
}

/// key_of(position) -> the rays in the order of (key, position).
template <class Key, class KeyOf>
void reorder(std::vector<Ray>& rays, const KeyOf& key_of) {
    std::vector<KeyedRay<Key>> entries(rays.size());
    for_each_index(rays.size(), [&](std::size_t i) {
        entries[i] = {key_of(i), static_cast<std::uint32_t>(i)};
    });
    sort_entries(entries);
    std::vector<Ray> ordered(rays.size());
    for_each_index(rays.size(), [&](std::size_t i) { ordered[i] = rays[entries[i].position]; });
    rays.swap(ordered);
}

}  // namespace

Aabb end_point_box(std::span<const Ray> rays, float far) {
    std::vector<Aabb> boxes((rays.size() + block_size - 1) / block_size);
    for_each_block(rays.size(), block_size, [&](std::size_t b, std::size_t begin, std::size_t end) {
        Aabb box = empty_box();
        for (const Ray& ray : rays.subspan(begin, end - begin)) {
            for (const float t : {ray.tmin, ray.tmax == infinity ? far : ray.tmax}) {
                const Double3 point = Double3(ray.origin) + Double3(ray.direction) * t;
                if (!is_finite(point)) continue;
                const Vec3 rounded = point.rounded();
                if (is_finite(Double3(rounded))) box = unite(box, {rounded, rounded});
            }
        }
        boxes[b] = box;
    });
    Aabb all = empty_box();
    for (const Aabb& box : boxes) all = unite(all, box);
    return all;
}

RayKey ray_key(const Ray& ray, const Aabb& box) {
    const Vec3 o = ray.origin;
    const Double3 d = normalized(Double3(ray.direction));
    const std::uint32_t cells[6] = {cell_of(part_of_extent(o.x, box.lo.x, box.hi.x), origin_bits),
                                    cell_of(part_of_extent(o.y, box.lo.y, box.hi.y), origin_bits),
                                    cell_of(part_of_extent(o.z, box.lo.z, box.hi.z), origin_bits),
                                    cell_of(d.x * 0.5 + 0.5, direction_bits),
                                    cell_of(d.y * 0.5 + 0.5, direction_bits),
                                    cell_of(d.z * 0.5 + 0.5, direction_bits)};
    RayKey key;
    for (int level = 23; level >= 21; --level)
        key.high = key.high << 3 | level_bits(cells, level, 3);
    for (int level = 20; level >= 14; --level)
        key.high = key.high << 6 | level_bits(cells, level, 6);
    for (int level = 13; level >= 4; --level)
        key.middle = key.middle << 6 | level_bits(cells, level, 6);
    for (int level = 3; level >= 0; --level)
        key.low = key.low << 6 | static_cast<std::uint32_t>(level_bits(cells, level, 6));
    return key;
}

void sort_rays(std::vector<Ray>& rays, float far) {
    const Aabb box = end_point_box(rays, far);
    reorder<RayKey>(rays, [&](std::size_t i) { return ray_key(rays[i], box); });
}

void shuffle_rays(std::vector<Ray>& rays, std::uint64_t seed) {
    reorder<std::uint64_t>(rays, [&](std::size_t i) { return hash_of(seed, i); });
}

}  // namespace raydix
