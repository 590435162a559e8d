// Turned pieces, bars, balls and rings -> patches.
#include "scene/patch_shapes.h"

#include <algorithm>
#include <cmath>

namespace raydix::builtin {

namespace {

constexpr double tau = 6.283185307179586;

Profile evaluate(const Turning& t, double v) {
    const double a = (1.0 - v) * (1.0 - v), b = 2.0 * v * (1.0 - v), c = v * v;
    return {(a * t.from.radius + b * t.control.radius) + c * t.to.radius,
            (a * t.from.height + b * t.control.height) + c * t.to.height};
}

bool is_straight(const Turning& t) {
    const double x = t.to.radius - t.from.radius, y = t.to.height - t.from.height;
    const double cx = t.control.radius - t.from.radius, cy = t.control.height - t.from.height;
    return std::abs(x * cy - y * cx) < 1e-9;
}

}  // namespace

Turning straight(Profile from, Profile to) {
    return {from, {0.5 * (from.radius + to.radius), 0.5 * (from.height + to.height)}, to};
}

void add_turned(PatchModel& model, std::initializer_list<Turning> pieces, const Lathe& lathe) {
    for (const Turning& piece : pieces) {
        const double widest = std::max(piece.from.radius, piece.to.radius);
        const double x = piece.to.radius - piece.from.radius;
        const double y = piece.to.height - piece.from.height;
        const double run = std::sqrt(x * x + y * y);
        const bool flat = is_straight(piece);
        const Cuts around{lathe.sides, tau * widest * lathe.detail};
        const Cuts along{flat ? 1u : lathe.bends, (flat ? 0.5 : 1.5) * run * lathe.detail};
        model.add_patch(
            [piece, lathe](double u, double v) {
                const Circle c = circle(u);
                const Profile p = evaluate(piece, v);
                const double groove =
                    lathe.flutes > 0 ? std::abs(circle(0.5 * u * lathe.flutes).sin) : 1.0;
                const double r = p.radius * (1.0 - lathe.flute_depth * (1.0 - groove));
                return Point{r * c.cos, p.height, -r * c.sin};
            },
            around, along);
    }
}

void add_tube(PatchModel& model, const Path& path, double radius, Point reference, Cuts around,
              Cuts along) {
    model.add_patch(
        [path, radius, reference](double u, double v) {
            const Point tangent = unit(path(v + 1e-4) - path(v - 1e-4));
            const Point side = unit(cross(tangent, reference));
            const Point other = cross(side, tangent);
            const Circle c = circle(u);
            return path(v) + (side * c.cos + other * c.sin) * radius;
        },
        around, along);
}

void add_ball(PatchModel& model, Point center, double radius, double detail) {
    model.add_patch(
        [center, radius](double u, double v) {
            const Circle around = circle(u), up = circle(mix(-0.2485, 0.2485, v));
            return center + Point{up.cos * around.cos, up.sin, -up.cos * around.sin} * radius;
        },
        {5, tau * radius * detail}, {3, 0.5 * tau * radius * detail});
}

void add_ring(PatchModel& model, Point center, double radius, double thickness, RingAxis axis,
              double detail) {
    const Path path = [=](double t) {
        const Circle c = circle(t);
        return center +
               (axis == RingAxis::y ? Point{c.cos, 0, -c.sin} : Point{c.cos, c.sin, 0}) * radius;
    };
    const Point reference = axis == RingAxis::y ? Point{0, 1, 0} : Point{0, 0, 1};
    add_tube(model, path, thickness, reference, {3, tau * thickness * detail},
             {8, tau * radius * detail});
}

}  // namespace raydix::builtin
