// The building of the scene `atrium`: floors, walls with windows, arcades, vaults, stairs,
// balustrades.
#include <algorithm>
#include <cmath>

#include "scene/atrium.h"
#include "scene/patch_shapes.h"

namespace raydix::builtin {

namespace {

/// A wall along x with a round-headed opening, between two planes z: soffit and both faces in one
/// patch, so that no light falls through its seams.
struct Opening {
    double center, half_width;  // of the opening, along x
    double half_bay;            // of the wall
    double foot, spring, top;   // wall from `foot`, arch from `spring`, wall up to `top`
    double near, far;           // z of the two faces
};

/// Inner edge at u: up the left jamb, round the arch, down the right one; or the wall's own outline
/// beside it.
Point opening_edge(const Opening& o, double u, bool outer) {
    const double jamb = u < 0.2 ? u / 0.2 : (u > 0.8 ? (1.0 - u) / 0.2 : 1.0);
    const double along = u < 0.2 ? 0.0 : (u > 0.8 ? 1.0 : (u - 0.2) / 0.6);
    if (u < 0.2 || u > 0.8) {
        const double side = u < 0.5 ? -1.0 : 1.0;
        const double reach = outer ? o.half_bay : o.half_width;
        return {o.center + side * reach, mix(o.foot, outer ? o.top : o.spring, jamb), 0.0};
    }
    if (outer) return {o.center + mix(-o.half_bay, o.half_bay, along), o.top, 0.0};
    const Circle c = circle(0.5 * (1.0 - along));
    return {o.center + o.half_width * c.cos, o.spring + o.half_width * c.sin, 0.0};
}

void add_opening(PatchModel& model, const Opening& o, double detail) {
    // Three pieces, so that the corners of the outline are vertices at any fineness.
    constexpr double ends[4] = {0.0, 0.2, 0.8, 1.0};
    for (int piece = 0; piece < 3; ++piece) {
        if (piece != 1 && o.spring <= o.foot) continue;
        const double from = ends[piece], to = ends[piece + 1];
        const Cuts columns = piece == 1 ? Cuts{8, 3.0 * o.half_width * detail} : Cuts{};
        model.add_patch(
            [o, from, to](double u, double v) {
                const int ring = static_cast<int>(v * 3.0 + 0.5);
                Point p = opening_edge(o, mix(from, to, u), ring == 0 || ring == 3);
                p.z = ring < 2 ? o.near : o.far;
                return p;
            },
            columns, {3, 0.0});
    }
}

/// What is left beside the arch when the wall stands on columns: from the springing to the wall's
/// corner.
void add_spandrels(PatchModel& model, const Opening& o) {
    for (const double side : {-1.0, 1.0})
        for (const double z : {o.near, o.far}) {
            const double inner = o.center + side * o.half_width,
                         outer = o.center + side * o.half_bay;
            model.add_quad({inner, o.spring, z}, {outer, o.spring, z},
                           {outer, 0.5 * (o.spring + o.top), z}, {outer, o.top, z});
        }
}

/// A half ring of mouldings along the front of an arch.
void add_archivolt(PatchModel& model, const Opening& o, double z, double thickness, double detail) {
    for (const double out : {0.03, 0.16}) {
        const double radius = o.half_width + out;
        add_tube(model,
                 [=](double t) {
                     const Circle c = circle(0.5 * (1.0 - t));
                     return Point{o.center + radius * c.cos, o.spring + radius * c.sin, z};
                 },
                 thickness, {0, 0, 1}, {4, 6.0 * thickness * detail}, {8, 4.0 * radius * detail});
    }
}

struct ColumnSize {
    double height, radius;
    int flutes;
    double detail;
    bool plain;
};

/// Rolls at the foot and under the capital, and four volutes.
void add_column_ornaments(PatchModel& model, const ColumnSize& size) {
    const double r = size.radius, h = size.height;
    add_turned(model,
               {{{1.15 * r, 1.0 * r}, {1.3 * r, 1.1 * r}, {1.05 * r, 1.2 * r}},
                {{0.82 * r, h - 1.9 * r}, {1.05 * r, h - 1.8 * r}, {0.84 * r, h - 1.7 * r}}},
               {size.detail, 8, 2, 0, 0.0});
    for (const double x : {-1.0, 1.0})
        for (const double z : {-1.0, 1.0})
            add_ring(model, {x * 1.15 * r, h - 0.6 * r, z * 1.2 * r}, 0.2 * r, 0.07 * r,
                     RingAxis::z, 0.4 * size.detail);
}

/// Plinth, base, fluted shaft, bell capital, abacus.
void add_column(PatchModel& model, Point foot, const ColumnSize& size) {
    model.set_frame({foot, {1.0, 0.0}});
    const double r = size.radius, h = size.height;
    model.add_box({-1.45 * r, 0, -1.45 * r}, {1.45 * r, 0.4 * r, 1.45 * r});
    model.add_box({-1.5 * r, h - 0.35 * r, -1.5 * r}, {1.5 * r, h, 1.5 * r});
    const std::uint32_t bends = size.plain ? 1 : 2;
    const Lathe smooth{size.detail, 8, bends, 0, 0.0};
    add_turned(model,
               {{{1.3 * r, 0.4 * r}, {1.6 * r, 0.55 * r}, {1.3 * r, 0.7 * r}},
                {{1.3 * r, 0.7 * r}, {1.02 * r, 0.85 * r}, {1.05 * r, 1.2 * r}}},
               smooth);
    add_turned(model, {{{1.0 * r, 1.2 * r}, {1.03 * r, 0.45 * h}, {0.82 * r, h - 1.7 * r}}},
               {size.detail, 8, bends, size.flutes, 0.12});
    add_turned(model, {{{0.84 * r, h - 1.7 * r}, {0.8 * r, h - 0.8 * r}, {1.35 * r, h - 0.35 * r}}},
               {1.5 * size.detail, 8, bends, size.flutes / 2, 0.06});
    if (!size.plain) add_column_ornaments(model, size);
    model.set_frame({});
}

/// A window in the outer wall: deep reveal, pane, bars.
void add_window(PatchModel& model, const Opening& o, bool plain) {
    add_opening(model, o, 2.0);
    const double pane = o.far, w = o.half_width;
    model.add_patch(
        [=](double u, double v) {
            const Circle c = circle(0.5 * (1.0 - u));
            return Point{o.center + w * c.cos, mix(o.foot, o.spring + w * c.sin, v), pane};
        },
        {8, 6.0 * w}, {});
    for (int i = plain ? 0 : -1; i <= (plain ? 0 : 1); ++i) {
        const double x = o.center + 0.5 * w * i;
        model.add_box({x - 0.02, o.foot, pane - 0.04}, {x + 0.02, o.spring + 0.8 * w, pane + 0.04});
    }
    for (double y = o.foot + 0.5; !plain && y < o.spring + 0.1; y += 0.5)
        model.add_box({o.center - w, y - 0.015, pane - 0.03},
                      {o.center + w, y + 0.015, pane + 0.03});
}

double bay_center(int bay) { return -Hall::half_length + Hall::bay * (bay + 0.5); }

void add_baluster(PatchModel& model, Point foot, double height) {
    model.set_frame({foot, {1.0, 0.0}});
    const double h = height;
    add_turned(model,
               {{{0.05, 0}, {0.09, 0.3 * h}, {0.03, 0.55 * h}},
                {{0.03, 0.55 * h}, {0.035, 0.8 * h}, {0.055, h}}},
               {14.0, 4, 1, 0, 0.0});
    model.set_frame({});
}

}  // namespace

void add_floors_and_walls(PatchModel& model, const Furnishing& amount) {
    const double l = Hall::half_length, w = Hall::outer, n = Hall::nave, g = Hall::gallery;
    model.add_quad({-l, 0, w}, {l, 0, w}, {l, 0, -w}, {-l, 0, -w});
    for (const double z : {-1.0, 1.0})  // long, thin inlays
        for (int i = 0; i < 3; ++i)
            model.add_box({-l + 0.5, 0.0, z * (3.0 + 0.3 * i) - 0.03},
                          {l - 0.5, 0.004, z * (3.0 + 0.3 * i) + 0.03});
    for (const double s : {-1.0, 1.0}) {
        model.add_box({-l, g - 0.35, s > 0 ? n - 0.3 : -w}, {l, g, s > 0 ? w : 0.3 - n});
        model.add_box({-l, g - 0.55, s * n - 0.42}, {l, g - 0.35, s * n + 0.42});  // cornice
        model.add_box({-l, Hall::spring - 0.2, s * n - 0.4}, {l, Hall::spring, s * n + 0.4});
        model.add_quad({-l, Hall::spring, s * n}, {l, Hall::spring, s * n},
                       {l, Hall::spring, s * w}, {-l, Hall::spring, s * w});  // gallery ceiling
        for (int bay = 0; bay < Hall::bays; ++bay)
            for (const double floor : {0.0, g}) {
                const double foot = floor + (floor > 0 ? 1.0 : 1.5);
                if (amount.plain && floor > 0) {
                    const double x0 = bay_center(bay) - 2.0, x1 = x0 + 4.0;
                    model.add_quad({x0, g, s * w}, {x1, g, s * w}, {x1, Hall::spring, s * w},
                                   {x0, Hall::spring, s * w});
                    continue;
                }
                add_window(model,
                           {bay_center(bay), 0.8, 2.0, foot, floor + 3.2,
                            floor + (floor > 0 ? 5.0 : 5.65), s * w, s * (w + 0.5)},
                           amount.plain);
                const double x = bay_center(bay);
                model.add_quad({x - 2, floor, s * w}, {x + 2, floor, s * w}, {x + 2, foot, s * w},
                               {x - 2, foot, s * w});
                model.add_quad({x - 0.8, foot, s * w}, {x + 0.8, foot, s * w},
                               {x + 0.8, foot, s * (w + 0.5)}, {x - 0.8, foot, s * (w + 0.5)});
            }
        model.add_box({s > 0 ? l : -l - 0.3, 0, -w - 0.6}, {s > 0 ? l + 0.3 : -l, 6.0, w + 0.6});
        for (const double z : {-1.0, 1.0})
            model.add_box({s > 0 ? l : -l - 0.3, 6.0, z > 0 ? n : -w - 0.6},
                          {s > 0 ? l + 0.3 : -l, Hall::spring + 0.2, z > 0 ? w + 0.6 : -n});
    }
}

void add_arcades(PatchModel& model, const Furnishing& amount) {
    for (const double s : {-1.0, 1.0}) {
        for (int i = 0; i <= Hall::bays; ++i) {
            const double x = -Hall::half_length + Hall::bay * i;
            add_column(model, {x, 0, s * Hall::nave}, {3.5, 0.32, 20, 5.0, amount.plain});
            add_column(model, {x, Hall::gallery, s * Hall::nave},
                       {2.6, 0.22, 16, 5.0, amount.plain});
        }
        for (int bay = 0; bay < Hall::bays; ++bay) {
            const double z = s * Hall::nave;
            const Opening low{bay_center(bay), 1.6,         2.0, 3.5, 3.5, 5.65,
                              z - s * 0.28,    z + s * 0.28};
            const Opening high{bay_center(bay), 1.7,         2.0, 8.6, 8.6, 10.9,
                               z - s * 0.22,    z + s * 0.22};
            for (const Opening& o : {low, high}) {
                add_opening(model, o, 3.0);
                add_spandrels(model, o);
                if (!amount.plain) add_archivolt(model, o, o.near, 0.035, 3.0);
            }
            if (amount.plain) continue;
            // A rosette between the cornice and each arch.
            add_ring(model, {bay_center(bay) - 2.0, 5.05, z - s * 0.3}, 0.22, 0.03, RingAxis::z,
                     5.0);
            add_ball(model, {bay_center(bay) - 2.0, 5.05, z - s * 0.28}, 0.1, 5.0);
        }
    }
}

void add_vaults(PatchModel& model) {
    const double l = Hall::half_length, n = Hall::nave;
    // One long strip per step around: the longest and thinnest triangles of the scene.
    model.add_patch(
        [=](double u, double v) {
            const Circle c = circle(0.5 * v);
            return Point{mix(-l, l, u), Hall::spring + n * c.sin, n * c.cos};
        },
        {1, 0.0}, {16, 6.0});
    for (int i = 0; i <= Hall::bays; ++i) {
        const double x = -l + Hall::bay * i;
        model.add_patch(  // a rib with a square section
            [=](double u, double v) {
                const Circle c = circle(0.5 * v);
                const int side = static_cast<int>(u * 3.0 + 0.5);
                const double r = side == 0 || side == 3 ? n : n - 0.25;
                return Point{x + (side < 2 ? -0.2 : 0.2), Hall::spring + r * c.sin, r * c.cos};
            },
            {3, 0.0}, {12, 24.0});
    }
    for (const double s : {-1.0, 1.0})
        for (int bay = 0; bay < Hall::bays; ++bay) {
            const double x = bay_center(bay), z = s * 0.5 * (Hall::nave + Hall::outer);
            model.add_patch(  // groin vault: the higher of two crossing barrels
                [=](double u, double v) {
                    const double a = 2.0 * u - 1.0, b = 2.0 * v - 1.0;
                    const double rise = std::sqrt(1.0 - std::min(a * a, b * b));
                    return Point{x + 2.0 * a, 3.6 + 2.0 * rise, z + 2.0 * b};
                },
                {4, 16.0}, {4, 16.0});
        }
}

void add_end_windows(PatchModel& model, const Furnishing& amount) {
    const double l = Hall::half_length, n = Hall::nave;
    for (const double s : {-1.0, 1.0}) {
        const double radius = 2.4, height = 10.5;
        for (int side = 0; side < 4; ++side)
            // The end wall above the gallery, from its outline to a round window, its reveal and
            // its pane. A patch for each side of the outline keeps the corners.
            model.add_patch(
                [=](double u, double v) {
                    const Circle c = circle(0.25 * (side + u - 0.5));
                    const int ring = static_cast<int>(v * 3.0 + 0.5);
                    if (ring > 0) {
                        const double r = ring == 3 ? 0.01 : radius;
                        return Point{s * (l + (ring > 1 ? 0.4 : 0.0)), height + r * c.sin,
                                     r * c.cos};
                    }
                    const double up = c.sin > 0 ? 16.2 - height : height - Hall::gallery;
                    const double stretch = 1.0 / std::max(std::abs(c.cos), std::abs(c.sin));
                    return Point{s * l, height + up * stretch * c.sin, (n + 0.2) * stretch * c.cos};
                },
                {4, 4.0}, {3, 0.0});
        // Tracery: petals around a hub.
        model.set_frame({{s * (l + 0.1), height, 0}, {0.0, 1.0}});
        add_ring(model, {}, radius, 0.12, RingAxis::z, 4.0);
        add_ring(model, {}, 0.55, 0.08, RingAxis::z, 4.0);
        const int petals = amount.plain ? 6 : 12;
        for (int i = 0; i < petals; ++i) {
            const Circle c = circle(static_cast<double>(i) / petals);
            add_ring(model, Point{c.cos, c.sin, 0} * 1.85, 0.46, 0.05, RingAxis::z, 4.0);
            add_tube(model,
                     [c](double t) {
                         return Point{c.cos, c.sin, 0} * mix(0.55, 1.4, t);
                     },
                     0.05, {0, 0, 1}, {4, 2.0}, {});
        }
        model.set_frame({});
    }
}

void add_stairs(PatchModel& model, const Furnishing& amount) {
    constexpr int steps = 30;
    const double rise = Hall::gallery / steps, run = 0.3, half = 1.6, top = -13.5;
    for (int i = 0; i < steps; ++i) {
        const double x = top + run * (steps - i), y = rise * (i + 1);
        model.add_box({x - run - 0.02, y - 0.12, -half}, {x + 0.02, y, half});
        if (!amount.plain)
            for (const double s : {-1.0, 1.0})
                add_baluster(model, {x - 0.5 * run, y, s * (half - 0.1)}, 0.85);
    }
    for (const double s : {-1.0, 1.0}) {
        const double z0 = s * half - 0.12, z1 = s * half + 0.12, foot = top + run * steps;
        const double lift = 0.85;
        model.add_hexahedron({{top, 5.6, z0},
                              {foot, 0.0, z0},
                              {top, 6.05, z0},
                              {foot, 0.12, z0},
                              {top, 5.6, z1},
                              {foot, 0.0, z1},
                              {top, 6.05, z1},
                              {foot, 0.12, z1}});
        const double r0 = s * (half - 0.1) - 0.06, r1 = s * (half - 0.1) + 0.06;
        model.add_hexahedron({{top, 6 + lift, r0},
                              {foot, 0.2 + lift, r0},
                              {top, 6.08 + lift, r0},
                              {foot, 0.28 + lift, r0},
                              {top, 6 + lift, r1},
                              {foot, 0.2 + lift, r1},
                              {top, 6.08 + lift, r1},
                              {foot, 0.28 + lift, r1}});
        model.add_box({foot - 0.15, 0, s * half - 0.2}, {foot + 0.25, 1.15, s * half + 0.2});
        add_ball(model, {foot + 0.05, 1.35, s * half}, 0.2, 6.0);
    }
    // The landing bridges both galleries at the end wall.
    model.add_box({-Hall::half_length, 5.65, -Hall::nave}, {top, 6.0, Hall::nave});
}

void add_balustrades(PatchModel& model, const Furnishing& amount) {
    for (const double s : {-1.0, 1.0})
        for (int bay = 0; bay < Hall::bays; ++bay) {
            const double x0 = bay_center(bay) - 1.75, x1 = bay_center(bay) + 1.75,
                         z = s * Hall::nave;
            if (bay == 0) continue;  // the landing
            model.add_box({x0, 6.0, z - 0.12}, {x1, 6.1, z + 0.12});
            model.add_box({x0, 6.9, z - 0.1}, {x1, 7.0, z + 0.1});
            for (int i = 0; i < amount.balusters; ++i)
                add_baluster(model, {mix(x0, x1, (i + 0.5) / amount.balusters), 6.1, z}, 0.8);
        }
}

}  // namespace raydix::builtin
