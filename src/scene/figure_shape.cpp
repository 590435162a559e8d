// Point -> signed distance and gradient of the sitting cat.
#include "scene/figure_shape.h"

#include <algorithm>
#include <array>

namespace raydix::builtin {

namespace {

/// A rounded cone from a to b; `blend` is the width over which it melts into what came before it.
struct Limb {
    Point a, b;
    double radius_a, radius_b, blend;
    bool mirrored;  // also at -x
};

constexpr Limb limbs[] = {
    {{0, 0.44, -0.34}, {0, 0.98, 0.06}, 0.41, 0.29, 0.0, false},           // trunk
    {{0, 1.00, 0.10}, {0, 1.34, 0.17}, 0.23, 0.19, 0.16, false},           // neck
    {{0, 0.86, 0.16}, {0, 0.98, 0.17}, 0.20, 0.20, 0.12, false},           // chest
    {{0.05, 1.51, 0.18}, {0.07, 1.48, 0.28}, 0.25, 0.20, 0.06, true},      // skull
    {{0.055, 1.42, 0.40}, {0.05, 1.40, 0.49}, 0.10, 0.08, 0.05, true},     // muzzle
    {{0, 1.445, 0.545}, {0, 1.446, 0.55}, 0.05, 0.05, 0.02, false},        // nose
    {{0.125, 1.545, 0.43}, {0.13, 1.545, 0.435}, 0.06, 0.06, 0.01, true},  // eyes
    {{0.165, 1.64, 0.15}, {0.170, 1.65, 0.15}, 0.15, 0.15, 0.05, true},    // ears: beads
    {{0.190, 1.77, 0.13}, {0.192, 1.78, 0.13}, 0.105, 0.105, 0.08, true},
    {{0.215, 1.875, 0.115}, {0.216, 1.88, 0.115}, 0.065, 0.065, 0.07, true},
    {{0.21, 0.92, 0.16}, {0.215, 0.48, 0.27}, 0.17, 0.115, 0.10, true},    // shoulders
    {{0.215, 0.48, 0.27}, {0.18, 0.09, 0.31}, 0.115, 0.10, 0.02, true},    // forelegs
    {{0.18, 0.085, 0.33}, {0.19, 0.075, 0.49}, 0.105, 0.085, 0.04, true},  // forepaws
    {{0.31, 0.40, -0.24}, {0.40, 0.30, 0.00}, 0.30, 0.22, 0.12, true},     // haunches
    {{0.45, 0.10, -0.15}, {0.53, 0.085, 0.22}, 0.11, 0.085, 0.05, true},   // hind feet
    {{0, 0.30, -0.66}, {0.22, 0.16, -0.85}, 0.16, 0.13, 0.12, false},      // tail
    {{0.22, 0.16, -0.85}, {0.48, 0.12, -0.87}, 0.13, 0.12, 0.02, false},
    {{0.48, 0.12, -0.87}, {0.72, 0.11, -0.72}, 0.12, 0.115, 0.02, false},
    {{0.72, 0.11, -0.72}, {0.85, 0.11, -0.45}, 0.115, 0.11, 0.02, false},
    {{0.85, 0.11, -0.45}, {0.88, 0.10, -0.12}, 0.11, 0.105, 0.02, false},
    {{0.88, 0.10, -0.12}, {0.80, 0.10, 0.16}, 0.105, 0.10, 0.02, false},
    {{0.80, 0.10, 0.16}, {0.60, 0.10, 0.30}, 0.10, 0.09, 0.02, false},  // its tip rests on the foot
};

SolidSample sample_limb(const Limb& limb, Point p) {
    const Point axis = limb.b - limb.a;
    const double t = std::clamp(dot(p - limb.a, axis) / dot(axis, axis), 0.0, 1.0);
    const Point away = p - (limb.a + axis * t);
    const double d = length(away);
    return {d - mix(limb.radius_a, limb.radius_b, t), d > 0.0 ? away * (1.0 / d) : Point{0, 1, 0}};
}

/// Polynomial smooth minimum: rounds the crease over a band of the given width.
SolidSample melt(const SolidSample& s, const SolidSample& t, double width) {
    const double h = width > 0.0
                         ? std::clamp(0.5 + 0.5 * (t.distance - s.distance) / width, 0.0, 1.0)
                         : (s.distance < t.distance ? 1.0 : 0.0);
    return {mix(t.distance, s.distance, h) - width * h * (1.0 - h), mix(t.gradient, s.gradient, h)};
}

/// A ball around a limb.
struct Reach {
    Point center;
    double radius;
};
std::array<Reach, std::size(limbs)> limb_reaches() {
    std::array<Reach, std::size(limbs)> reaches;
    for (std::size_t i = 0; i < std::size(limbs); ++i)
        reaches[i] = {
            mix(limbs[i].a, limbs[i].b, 0.5),
            0.5 * length(limbs[i].b - limbs[i].a) + std::max(limbs[i].radius_a, limbs[i].radius_b)};
    return reaches;
}

/// Too far away to change a solid that is `distance` from p.
bool out_of_reach(const Reach& reach, const Limb& limb, Point p, double distance) {
    const double far = distance + limb.blend + reach.radius;
    const Point away = p - reach.center;
    return far > 0.0 && dot(away, away) >= far * far;
}

}  // namespace

SolidSample figure_solid(Point p) {
    SolidSample solid{1e3, {0, 1, 0}};
    static const std::array<Reach, std::size(limbs)> reaches = limb_reaches();
    const Point mirror{-p.x, p.y, p.z};
    for (std::size_t i = 0; i < std::size(limbs); ++i) {
        const Limb& limb = limbs[i];
        if (!out_of_reach(reaches[i], limb, p, solid.distance))
            solid = melt(solid, sample_limb(limb, p), limb.blend);
        if (!limb.mirrored || out_of_reach(reaches[i], limb, mirror, solid.distance)) continue;
        SolidSample other = sample_limb(limb, mirror);
        other.gradient.x = -other.gradient.x;
        solid = melt(solid, other, limb.blend);
    }
    return solid;
}

}  // namespace raydix::builtin
