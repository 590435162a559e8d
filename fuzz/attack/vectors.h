// The little vector arithmetic that generators need, in float or double.
#pragma once

#include <raydix/types.h>

#include <cmath>

namespace raydix::attack {

template <class V>
using ScalarIn = decltype(V::x);

template <class V>
concept Vector = requires(V v) {
    v.x;
    v.y;
    v.z;
};

template <Vector V>
constexpr V operator+(V a, V b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <Vector V>
constexpr V operator-(V a, V b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <Vector V>
constexpr V operator*(V a, ScalarIn<V> s) {
    return {a.x * s, a.y * s, a.z * s};
}
template <Vector V>
constexpr V cross(V a, V b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <Vector V>
constexpr ScalarIn<V> dot(V a, V b) {
    return (a.x * b.x + a.y * b.y) + a.z * b.z;
}
template <Vector V>
constexpr ScalarIn<V>& at(V& v, std::uint32_t axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}
template <Vector V>
constexpr ScalarIn<V> at(const V& v, std::uint32_t axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}
template <Vector V>
bool is_finite(const V& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
inline Vec3d wide(Vec3 v) { return {v.x, v.y, v.z}; }
inline Vec3 narrow(Vec3d v) {
    return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

/// Of points in space or in a plane, as the documentation of distances has it: in this order, no
/// contraction.
template <class P>
ScalarIn<P> distance_squared(const P& a, const P& b) {
    const auto dx = a.x - b.x, dy = a.y - b.y;
    if constexpr (requires { a.z; }) {
        const auto dz = a.z - b.z;
        return (dx * dx + dy * dy) + dz * dz;
    } else {
        return dx * dx + dy * dy;
    }
}

}  // namespace raydix::attack
