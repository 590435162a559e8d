// Shapes that architecture and furniture are made of, added to a patch model in its current frame.
#pragma once

#include <functional>
#include <initializer_list>

#include "scene/patch_model.h"

namespace raydix::builtin {

/// Radius and height of a turned piece.
struct Profile {
    double radius, height;
};

/// A quadratic curve of the profile.
struct Turning {
    Profile from, control, to;
};
/// A straight piece.
Turning straight(Profile from, Profile to);

struct Lathe {
    double detail = 4.0;       // cuts per metre and unit of fineness
    std::uint32_t sides = 6;   // least number around
    std::uint32_t bends = 2;   // least number along a curved piece; straight ones start at 1
    int flutes = 0;            // grooves around
    double flute_depth = 0.0;  // as a share of the radius
};
/// Surfaces of revolution about the frame's y axis, one patch a piece.
void add_turned(PatchModel& model, std::initializer_list<Turning> pieces, const Lathe& lathe);

/// t in [0, 1] -> point on the middle line.
using Path = std::function<Point(double t)>;
/// A round bar of `radius` along `path`; `reference` must never be parallel to it.
void add_tube(PatchModel& model, const Path& path, double radius, Point reference, Cuts around,
              Cuts along);
/// A ball; its poles are cut off at a hundredth of the radius.
void add_ball(PatchModel& model, Point center, double radius, double detail);

/// A ring about an axis along z through `center`, or lying flat about y.
enum class RingAxis { y, z };
void add_ring(PatchModel& model, Point center, double radius, double thickness, RingAxis axis,
              double detail);

}  // namespace raydix::builtin
