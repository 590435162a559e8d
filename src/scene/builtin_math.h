// Arithmetic of the built-in scenes: points in double, sine and cosine, random numbers, smooth
// noise. Only + - * / sqrt and integer bits, which every machine rounds alike: the scenes must have
// the same bits everywhere, and the sin, cos and pow of two C libraries do not.
#pragma once

#include <raydix/types.h>

#include <cmath>
#include <cstdint>

namespace raydix::builtin {

struct Point {
    double x = 0.0, y = 0.0, z = 0.0;
};

inline Point operator+(Point a, Point b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Point operator-(Point a, Point b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Point operator*(Point a, double s) { return {a.x * s, a.y * s, a.z * s}; }
inline Point operator*(double s, Point a) { return a * s; }
inline double dot(Point a, Point b) { return (a.x * b.x + a.y * b.y) + a.z * b.z; }
inline Point cross(Point a, Point b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double length(Point a) { return std::sqrt(dot(a, a)); }
/// The zero vector stays zero.
inline Point unit(Point a) {
    const double l = length(a);
    return l > 0.0 ? a * (1.0 / l) : a;
}
inline Point mix(Point a, Point b, double t) { return a + (b - a) * t; }
inline double mix(double a, double b, double t) { return a + (b - a) * t; }
/// To the mesh's float32; + 0.0f makes -0 into +0.
inline Vec3 to_vec3(Point p) {
    return {static_cast<float>(p.x) + 0.0f, static_cast<float>(p.y) + 0.0f,
            static_cast<float>(p.z) + 0.0f};
}

struct Circle {
    double cos, sin;
};
/// Cosine and sine of an angle in whole turns (1 = 360 degrees); error below 1e-13.
inline Circle circle(double turns) {
    const double quarter = std::floor(turns * 4.0 + 0.5);
    const double x = (turns * 4.0 - quarter) * 1.5707963267948966;  // within a quarter of pi
    const double q = x * x;
    const double s =
        x * (1.0 + q * (-1.0 / 6 +
                        q * (1.0 / 120 +
                             q * (-1.0 / 5040 +
                                  q * (1.0 / 362880 + q * (-1.0 / 39916800 + q / 6227020800.0))))));
    const double c =
        1.0 +
        q * (-0.5 + q * (1.0 / 24 + q * (-1.0 / 720 + q * (1.0 / 40320 + q * (-1.0 / 3628800 +
                                                                              q / 479001600.0)))));
    switch (static_cast<std::int64_t>(quarter) & 3) {
        case 0:
            return {c, s};
        case 1:
            return {-s, c};
        case 2:
            return {-c, -s};
        default:
            return {s, -c};
    }
}

/// Scatters the bits of a number over all 64 (two rounds of multiply and shift).
inline std::uint64_t scramble(std::uint64_t x) {
    x = (x ^ (x >> 32)) * 0xD6E8FEB86659FD93ull;
    x = (x ^ (x >> 32)) * 0xD6E8FEB86659FD93ull;
    return x ^ (x >> 32);
}

/// A stream of random numbers fixed by (seed, index): element i of a scene draws from its own,
/// whatever the thread.
/// Never draw twice among the arguments of one call or the operands of one sum: compilers differ in
/// their order there.
class Random {
public:
    explicit Random(std::uint64_t seed, std::uint64_t index = 0)
        : state_(scramble(seed + 0x9E3779B97F4A7C15ull) ^
                 scramble(index * 0xA24BAED4963EE407ull + 1)) {}

    std::uint64_t bits() {
        state_ += 0x9E3779B97F4A7C15ull;
        return scramble(state_);
    }
    /// In [0, 1).
    double unit() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
    double range(double lo, double hi) { return lo + (hi - lo) * unit(); }
    /// In [-1, 1).
    double sign() { return 2.0 * unit() - 1.0; }
    /// In [0, n).
    std::uint64_t below(std::uint64_t n) {
        return static_cast<std::uint64_t>(unit() * static_cast<double>(n));
    }
    /// Nearly normal with deviation 1: the sum of twelve uniform numbers.
    double normal() {
        double sum = -6.0;
        for (int i = 0; i < 12; ++i) sum += unit();
        return sum;
    }
    /// Evenly over the unit sphere.
    Point direction() {
        const double y = sign();
        const Circle c = circle(unit());
        const double r = std::sqrt(1.0 - y * y);
        return {r * c.cos, y, r * c.sin};
    }

private:
    std::uint64_t state_;
};

/// Smooth noise of about -1 to 1 with features of size 1: gradients on the integer lattice, blended
/// by quintics.
double noise(Point p, std::uint64_t seed);

/// `octaves` layers of noise, each twice as fine and half as strong as the one before.
double layered_noise(Point p, int octaves, std::uint64_t seed);

}  // namespace raydix::builtin
