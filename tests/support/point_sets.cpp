#include "support/point_sets.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <random>

#include "base/math.h"

namespace raydix::test {
namespace {

using Random = std::mt19937_64;

float unit(Random& random) { return static_cast<float>(random() >> 40) * 0x1p-24f; }
Vec3 in_cube(Random& random) {
    const float x = unit(random), y = unit(random);
    return {x, y, unit(random)};
}

}  // namespace

std::vector<PointSet> point_sets(std::size_t count, std::uint64_t seed) {
    Random random(seed);
    std::vector<PointSet> sets;
    const auto add = [&](const char* name, std::size_t n,
                         const std::function<Vec3(std::size_t)>& f) {
        PointSet set{name, {}};
        for (std::size_t i = 0; i < n; ++i) set.points.push_back(f(i));
        sets.push_back(std::move(set));
    };
    const auto scaled = [&](float x, float y, float z) {
        const Vec3 p = in_cube(random);
        return Vec3{x * p.x, y * p.y, z * p.z};
    };
    for (const std::size_t n : {0u, 1u, 2u, 3u, 5u})
        add("few", n, [&](std::size_t) { return in_cube(random); });
    add("uniform", count, [&](std::size_t) { return in_cube(random); });
    add("around 0", count, [&](std::size_t) { return in_cube(random) - Vec3{0.5f, 0.5f, 0.5f}; });
    add("clustered", count, [&](std::size_t i) {
        const auto c = static_cast<float>(i % 5);
        return Vec3{c, 2 * c, -c} + scaled(1e-5f, 1e-5f, 1e-5f);
    });
    add("equal", count, [&](std::size_t) { return Vec3{1, 2, 3}; });
    add("two values", count, [&](std::size_t i) {
        return i % 3 == 0 ? Vec3{1, 2, 3} : Vec3{-4, 0, 9};
    });
    add("heaps of equal ones", count, [&](std::size_t) {
        return Vec3{static_cast<float>(random() % 4), static_cast<float>(random() % 3), 0};
    });
    add("equal ones beside others", count, [&](std::size_t i) {
        return i % 2 == 0 ? Vec3{0.3f, 0.4f, 0.5f} : in_cube(random);
    });
    add("line", count, [&](std::size_t) { return scaled(0, 1, 0); });
    add("plane", count, [&](std::size_t) { return scaled(1, 0, 1) + Vec3{0, 7, 0}; });
    add("huge", count, [&](std::size_t) {
        return scaled(2e12f, 1e12f, -1e12f) - Vec3{1e12f, 0, 0};
    });
    add("tiny", count, [&](std::size_t) { return scaled(1e-30f, 1e-38f, -1e-44f); });
    add("GPS", count, [&](std::size_t) { return scaled(30, 30, 30) + Vec3{5e6f, 4e5f, 0}; });
    add("lattice", count, [&](std::size_t i) {
        return Vec3{static_cast<float>(i % 16), static_cast<float>(i / 16 % 16),
                    static_cast<float>(i / 256)};
    });
    add("invalid among them", count, [&](std::size_t i) {
        return i % 7 == 0    ? Vec3{infinity, 0, 0}
               : i % 11 == 0 ? Vec3{0, 2e12f, std::numeric_limits<float>::quiet_NaN()}
                             : in_cube(random);
    });
    add("all invalid", 20, [&](std::size_t) { return Vec3{0, -infinity, 0}; });
    return sets;
}

std::vector<Vec3> queries_for(const std::vector<Vec3>& points, std::size_t count,
                              std::uint64_t seed) {
    Random random(seed);
    Aabb box = empty_box();
    for (const Vec3& p : points)
        if (in_range(p)) box = unite(box, {p, p});
    if (is_empty(box)) box = {{0, 0, 0}, {1, 1, 1}};
    const Vec3 size = box.hi - box.lo;
    const auto in_box = [&] {
        const Vec3 p = in_cube(random);
        return box.lo + Vec3{p.x * size.x, p.y * size.y, p.z * size.z};
    };
    std::vector<Vec3> queries{{std::numeric_limits<float>::quiet_NaN(), 0, 0},
                              {0, infinity, 0},
                              {1e30f, -1e30f, 1e30f},
                              box.lo,
                              box.hi};
    while (queries.size() < count) {
        switch (queries.size() % 4) {
            case 0:
                queries.push_back(in_box());
                break;
            case 1:
                queries.push_back(points.empty() ? in_box() : points[random() % points.size()]);
                break;
            case 2:
                queries.push_back(in_box() + 2.0f * (in_box() - box.lo) - size);
                break;
            default:
                queries.push_back({in_box().x, box.lo.y, box.hi.z});
        }
    }
    return queries;
}

}  // namespace raydix::test
