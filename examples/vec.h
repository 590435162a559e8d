// What the examples need beside the library: a little vector arithmetic and random numbers.
#pragma once

#include <raydix/types.h>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>

namespace example {

using raydix::Vec3;

inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator*(Vec3 a, Vec3 b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
inline Vec3 operator*(float s, Vec3 v) { return {s * v.x, s * v.y, s * v.z}; }
inline Vec3& operator+=(Vec3& a, Vec3 b) { return a = a + b; }
inline float dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(Vec3 a, Vec3 b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline float length(Vec3 v) { return std::sqrt(dot(v, v)); }
inline Vec3 unit(Vec3 v) { return (1.0f / length(v)) * v; }

/// Two unit vectors that make a right-handed frame with the unit vector `n` (Duff et al. 2017).
struct Frame {
    Vec3 s, t, n;
    explicit Frame(Vec3 normal) : n(normal) {
        const float sign = std::copysign(1.0f, n.z), a = -1.0f / (sign + n.z), b = n.x * n.y * a;
        s = {1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x};
        t = {b, sign + n.y * n.y * a, -n.y};
    }
    [[nodiscard]] Vec3 operator()(float x, float y, float z) const { return x * s + y * t + z * n; }
};

/// SplitMix64 (Steele, Lea, Flood 2014): each stream starts at a number of its own.
class Random {
public:
    explicit Random(std::uint64_t stream) : state_(stream) { next(); }
    /// In [0, 1).
    float operator()() { return static_cast<float>(next() >> 40) * 0x1p-24f; }

private:
    std::uint64_t next() {
        std::uint64_t z = state_ += 0x9E3779B97F4A7C15u;
        z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
        z = (z ^ z >> 27) * 0x94D049BB133111EBu;
        return z ^ z >> 31;
    }
    std::uint64_t state_;
};

/// A direction about frame.n, with density cosine / pi.
inline Vec3 cosine_direction(const Frame& frame, float r1, float r2) {
    const float angle = 2.0f * std::numbers::pi_v<float> * r1, radius = std::sqrt(r2);
    return frame(radius * std::cos(angle), radius * std::sin(angle), std::sqrt(1.0f - r2));
}
/// The same by two numbers of `random`, in an order that does not depend on the compiler.
template <class Random>
Vec3 cosine_direction(const Frame& frame, Random& random) {
    const float r2 = random(), r1 = random();
    return cosine_direction(frame, r1, r2);
}

/// FNV-1a over the bytes of plain values: equal pictures, equal numbers.
template <class T>
std::uint64_t hash_of(std::span<const T> values) {
    std::uint64_t hash = 0xCBF29CE484222325u;
    for (const std::byte b : std::as_bytes(values))
        hash = (hash ^ std::to_integer<std::uint64_t>(b)) * 0x100000001B3u;
    return hash;
}

}  // namespace example
