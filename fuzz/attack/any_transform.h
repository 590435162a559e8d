// Transforms of instances: scaled, sheared, mirrored, moved.
#pragma once

#include <cmath>
#include <cstddef>
#include <numbers>
#include <type_traits>

#include "attack/random.h"

namespace raydix::attack {

/// A quarter turn as cos and sin give it, scaled by a power of two: lengths of directions come out
/// beside one.
template <class Affine>
Affine quarter_turn(Random& random) {
    using Scalar = std::remove_reference_t<decltype(Affine{}.m[0][0])>;
    const Scalar angle = Scalar(std::numbers::pi / 2) * Scalar(random.below(4)),
                 scale = std::ldexp(Scalar(1), random.whole(-4, 4));
    const std::size_t axis = random.below(3), p = (axis + 1) % 3, q = (axis + 2) % 3;
    Affine t;
    for (auto& row : t.m)
        for (auto& x : row) x = 0;
    t.m[axis][axis] = scale;
    t.m[p][p] = t.m[q][q] = scale * std::cos(angle);
    t.m[p][q] = scale * std::sin(angle), t.m[q][p] = -t.m[p][q];
    return t;
}

/// Turned, mirrored, sheared, scaled and moved.
template <class Affine>
Affine any_transform(Random& random) {
    Affine t;
    const float scale = random.power_of_ten(-2, 2), far = random.chance(0.2) ? 1000.0f : 3.0f;
    for (std::size_t row = 0; row < 3; ++row) {
        for (std::size_t column = 0; column < 3; ++column) {
            const float shear = random.chance(0.5) ? random.sign_unit() : 0.0f;
            t.m[row][column] = scale * ((row == column ? 1.5f : 0.0f) + shear * 0.5f);
        }
        t.m[row][3] = random.sign_unit() * far;
    }
    if (random.chance(0.3))
        for (auto& x : t.m[random.below(3)]) x = -x;
    if (random.chance(0.2)) t = Affine{};
    if (random.chance(0.15)) t = quarter_turn<Affine>(random);
    return t;
}

}  // namespace raydix::attack
