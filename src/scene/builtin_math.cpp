// Gradient noise for terrain, bark and sculpted surfaces: point -> about [-1, 1].
#include "scene/builtin_math.h"

namespace raydix::builtin {

namespace {

/// Slope at a lattice corner, dotted with the way from there.
double corner(std::int64_t x, std::int64_t y, std::int64_t z, Point away, std::uint64_t seed) {
    const auto key = static_cast<std::uint64_t>(x) * 0x8DA6B343ull ^
                     static_cast<std::uint64_t>(y) * 0xD8163841ull ^
                     static_cast<std::uint64_t>(z) * 0xCB1AB31Full;
    const std::uint64_t h = scramble(key + seed);
    const auto slope = [&](int shift) {
        return static_cast<double>(h >> shift & 0xFFFF) * (2.0 / 65535.0) - 1.0;
    };
    return (slope(0) * away.x + slope(16) * away.y) + slope(32) * away.z;
}

double fade(double t) { return t * t * t * (t * (t * 6.0 - 15.0) + 10.0); }

}  // namespace

double noise(Point p, std::uint64_t seed) {
    const Point base{std::floor(p.x), std::floor(p.y), std::floor(p.z)};
    const auto x = static_cast<std::int64_t>(base.x);
    const auto y = static_cast<std::int64_t>(base.y);
    const auto z = static_cast<std::int64_t>(base.z);
    const Point f = p - base;
    const double u = fade(f.x), v = fade(f.y), w = fade(f.z);
    const auto row = [&](int dy, int dz) {
        const double a = corner(x, y + dy, z + dz, {f.x, f.y - dy, f.z - dz}, seed);
        const double b = corner(x + 1, y + dy, z + dz, {f.x - 1.0, f.y - dy, f.z - dz}, seed);
        return mix(a, b, u);
    };
    const double near = mix(row(0, 0), row(1, 0), v);
    const double far = mix(row(0, 1), row(1, 1), v);
    return 1.5 * mix(near, far, w);
}

double layered_noise(Point p, int octaves, std::uint64_t seed) {
    double sum = 0.0, strength = 1.0;
    for (int i = 0; i < octaves; ++i) {
        sum += strength * noise(p, seed + static_cast<std::uint64_t>(i));
        // An odd offset keeps the lattices of the layers from lining up at the origin.
        p = 2.0 * p + Point{17.31, 9.73, 5.17};
        strength *= 0.5;
    }
    return sum;
}

}  // namespace raydix::builtin
