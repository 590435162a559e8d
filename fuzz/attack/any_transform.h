// Transforms of instances: scaled, sheared, mirrored, moved.
#pragma once

#include <cstddef>

#include "attack/random.h"

namespace raydix::attack {

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
    return t;
}

}  // namespace raydix::attack
