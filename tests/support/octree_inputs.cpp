#include "support/octree_inputs.h"

#include <functional>
#include <random>

namespace raydix::test {
namespace {

using Random = std::mt19937_64;

float unit_float(Random& random) { return static_cast<float>(random() >> 40) * 0x1p-24f; }

}  // namespace

std::vector<NamedPoints> octree_inputs(std::size_t n, std::uint64_t seed) {
    Random r(seed);
    std::vector<NamedPoints> inputs;
    const auto add = [&](const char* name, std::size_t count,
                         const std::function<Vec3(std::size_t)>& make) {
        NamedPoints input{name, {}};
        for (std::size_t i = 0; i < count; ++i) input.points.push_back(make(i));
        inputs.push_back(std::move(input));
    };
    const auto cube = [&] { return Vec3{unit_float(r), unit_float(r), unit_float(r)}; };
    const float nan = std::numeric_limits<float>::quiet_NaN();
    for (const std::size_t few : {0u, 1u, 2u, 3u, 9u})
        add("few", few, [&](std::size_t) { return cube(); });
    add("uniform", n, [&](std::size_t) { return cube(); });
    add("clusters", n, [&](std::size_t i) {
        const auto c = static_cast<float>(i % 7), s = 1e-6f * static_cast<float>(1 + i % 3);
        return Vec3{c + s * unit_float(r), 2 * c - s * unit_float(r), s * unit_float(r)};
    });
    add("few values", n, [&](std::size_t) {
        return Vec3{static_cast<float>(r() % 4), static_cast<float>(r() % 3), -0.0f};
    });
    add("equal", n, [](std::size_t) { return Vec3{1, 2, 3}; });
    add("line", n, [&](std::size_t) { return Vec3{0, 5 * unit_float(r), 0}; });
    add("diagonal", n, [&](std::size_t) {
        const float t = unit_float(r);
        return Vec3{t, t, t};
    });
    add("plane", n, [&](std::size_t) { return Vec3{unit_float(r), 7, unit_float(r)}; });
    // A close pair in one corner and one point far away: single children down to the last level.
    add("close pair", 3, [](std::size_t i) {
        return i == 0 ? Vec3{1, 1, 1} : Vec3{static_cast<float>(i) * 1e-6f, 0, 0};
    });
    add("close pairs", n / 2 * 2, [&](std::size_t i) {
        static Vec3 last;
        if (i % 2 == 0) return last = cube();
        return Vec3{last.x + 3e-7f, last.y, last.z};
    });
    add("invalid among them", n, [&](std::size_t i) {
        if (i % 5 == 0) return Vec3{nan, 0, 0};
        if (i % 7 == 0) return Vec3{0, 2e12f, 0};
        return i % 11 == 0 ? Vec3{0, 0, -std::numeric_limits<float>::infinity()} : cube();
    });
    add("all invalid", 5, [&](std::size_t) { return Vec3{0, nan, 0}; });
    add("huge", n, [&](std::size_t) {
        return Vec3{2e12f * unit_float(r) - 1e12f, 1e12f * unit_float(r), -1e12f * unit_float(r)};
    });
    add("corners of what is allowed", 8, [](std::size_t i) {
        const auto side = [&](int bit) { return i >> bit & 1 ? 1e12f : -1e12f; };
        return Vec3{side(0), side(1), side(2)};
    });
    add("tiny", n, [&](std::size_t) {
        return Vec3{1e-30f * unit_float(r), 1e-38f * unit_float(r), -1e-44f * unit_float(r)};
    });
    add("denormal", n / 4, [&](std::size_t) {
        return Vec3{1e-44f * unit_float(r), 0, -1e-43f * unit_float(r)};
    });
    add("far from the origin", n, [&](std::size_t) {
        return Vec3{5e6f + 30 * unit_float(r), 4e5f + 30 * unit_float(r), 30 * unit_float(r)};
    });
    add("around the origin", n, [&](std::size_t) {
        return Vec3{unit_float(r) - 0.5f, (unit_float(r) - 0.5f) * 1e-3f,
                    1e-9f * (unit_float(r) - 0.5f)};
    });
    add("lattice", n, [](std::size_t i) {
        return Vec3{static_cast<float>(i % 8), static_cast<float>(i / 8 % 8),
                    static_cast<float>(i / 64 % 8)};
    });
    return inputs;
}

}  // namespace raydix::test
