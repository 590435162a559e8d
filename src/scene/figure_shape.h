// The solid behind the scene `figure`: a sitting cat, as a smooth union of tapered capsules.
#pragma once

#include "scene/builtin_math.h"

namespace raydix::builtin {

struct SolidSample {
    double distance;  // below 0 inside; near the surface about the distance in metres
    Point gradient;
};

/// Feet at y = 0, looking along +z, about 1.9 high.
SolidSample figure_solid(Point p);

/// A lattice of cubic cells that holds it, with a free layer all around.
inline constexpr double figure_cell = 0.1;
inline constexpr Point figure_low{-1.0, -0.25, -1.15};
inline constexpr int figure_cells[3] = {21, 25, 20};

}  // namespace raydix::builtin
