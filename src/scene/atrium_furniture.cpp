// What stands and hangs in the scene `atrium`: tables, chairs, books, vases, lamps, drapes, a
// statue.
#include <cmath>

#include "scene/atrium.h"
#include "scene/builtin.h"
#include "scene/patch_shapes.h"

namespace raydix::builtin {

namespace {

/// `inner` standing in `outer`.
Frame inside(const Frame& outer, Point at, double turns) {
    const Circle c = circle(turns);
    return {outer.place(at),
            {outer.turn.cos * c.cos - outer.turn.sin * c.sin,
             outer.turn.sin * c.cos + outer.turn.cos * c.sin}};
}

void add_vase(PatchModel& model, const Frame& frame, double height, int ribs) {
    model.set_frame(frame);
    const double h = height;
    add_turned(model,
               {straight({0.002 * h, 0.005 * h}, {0.16 * h, 0.0}),
                {{0.16 * h, 0}, {0.5 * h, 0.35 * h}, {0.2 * h, 0.7 * h}},
                {{0.2 * h, 0.7 * h}, {0.07 * h, 0.85 * h}, {0.2 * h, h}},
                {{0.19 * h, h}, {0.05 * h, 0.85 * h}, {0.18 * h, 0.6 * h}}},
               {12.0, 6, 2, ribs, 0.05});
}

void add_book(PatchModel& model, const Frame& frame, Point size) {
    model.set_frame(frame);
    const double t = 0.08 * size.y;
    model.add_box({-0.5 * size.x, 0, -0.5 * size.z}, {0.5 * size.x, t, 0.5 * size.z});
    model.add_box({-0.48 * size.x, t, -0.46 * size.z}, {0.46 * size.x, size.y - t, 0.46 * size.z});
    model.add_box({-0.5 * size.x, size.y - t, -0.5 * size.z}, {0.5 * size.x, size.y, 0.5 * size.z});
}

void add_chair(PatchModel& model, const Frame& frame) {
    model.set_frame(frame);
    model.add_box({-0.22, 0.43, -0.22}, {0.22, 0.47, 0.22});
    for (const double x : {-0.19, 0.19}) {
        model.add_box({x - 0.02, 0, 0.17}, {x + 0.02, 0.43, 0.21});
        model.add_hexahedron({{x - 0.02, 0, -0.22},
                              {x + 0.02, 0, -0.22},
                              {x - 0.02, 1.0, -0.30},
                              {x + 0.02, 1.0, -0.30},
                              {x - 0.02, 0, -0.18},
                              {x + 0.02, 0, -0.18},
                              {x - 0.02, 1.0, -0.26},
                              {x + 0.02, 1.0, -0.26}});
    }
    model.add_patch(  // a curved back
        [](double u, double v) {
            const double a = 2.0 * u - 1.0;
            return Point{0.19 * a, mix(0.72, 0.98, v), -0.25 - 0.06 * (1.0 - a * a) - 0.02 * v};
        },
        {3, 6.0}, {1, 2.0});
    model.add_patch(  // a cushion
        [](double u, double v) {
            const double a = 2.0 * u - 1.0, b = 2.0 * v - 1.0;
            return Point{0.2 * a, 0.47 + 0.05 * (1.0 - a * a * a * a) * (1.0 - b * b * b * b),
                         0.2 * b};
        },
        {2, 8.0}, {2, 8.0});
}

void add_candlestick(PatchModel& model, const Frame& frame) {
    model.set_frame(frame);
    add_turned(model,
               {{{0.07, 0}, {0.07, 0.03}, {0.015, 0.05}},
                {{0.015, 0.05}, {0.03, 0.1}, {0.012, 0.16}},
                {{0.012, 0.16}, {0.02, 0.2}, {0.04, 0.21}},
                straight({0.012, 0.2}, {0.012, 0.36}),
                straight({0.012, 0.36}, {0.001, 0.37})},
               {30.0, 4, 1, 0, 0.0});
}

void add_table(PatchModel& model, const Frame& frame, const Furnishing& amount, Random& random) {
    model.set_frame(frame);
    model.add_box({-1.6, 0.74, -0.55}, {1.6, 0.79, 0.55});
    model.add_box({-1.45, 0.64, -0.42}, {1.45, 0.74, 0.42});
    for (const double x : {-1.35, 1.35})
        for (const double z : {-0.36, 0.36}) {
            model.set_frame(inside(frame, {x, 0, z}, 0.0));
            add_turned(model,
                       {{{0.03, 0}, {0.09, 0.1}, {0.035, 0.2}},
                        {{0.035, 0.2}, {0.09, 0.45}, {0.05, 0.64}}},
                       {8.0, 4, 2, 0, 0.0});
        }
    const int side = amount.chairs / 2;
    for (int i = 0; i < side; ++i) {
        const double x = mix(-1.35, 1.35, (i + 0.5) / side);
        for (const double turn : {0.0, 0.5}) {
            const Point at{x + 0.05 * random.sign(), 0,
                           (turn > 0.0 ? 1.0 : -1.0) * random.range(0.75, 0.9)};
            add_chair(model, inside(frame, at, turn + 0.02 * random.sign()));
        }
    }
    const Point vase{0.1 * random.sign(), 0.79, 0.1 * random.sign()};
    const double height = random.range(0.3, 0.45);
    const int ribs = static_cast<int>(random.below(3)) * 8;
    add_vase(model, inside(frame, vase, random.unit()), height, ribs);
    for (const double x : {-0.8, 0.8})
        if (!amount.plain) add_candlestick(model, inside(frame, {x, 0.79, 0.0}, 0.0));
    for (int i = 0; i < side && !amount.plain; ++i) {  // small piles of books
        double y = 0.79;
        const Point at{mix(-1.3, 1.3, random.unit()), 0, 0.3 * random.sign()};
        for (std::uint64_t k = random.below(4); k > 0; --k) {
            const Point size{random.range(0.15, 0.24), random.range(0.02, 0.05),
                             random.range(0.2, 0.3)};
            add_book(model, inside(frame, {at.x, y, at.z}, random.unit()), size);
            y += size.y;
        }
    }
}

}  // namespace

void add_tables(PatchModel& model, const Furnishing& amount, std::uint64_t seed) {
    Random random(seed, 1);
    for (const double x : {8.0, 3.5, -1.0}) {
        if (amount.plain && x < 0.0) break;
        for (const double z : {-2.1, 2.1})
            add_table(model, {{x, 0, z}, {1.0, 0.0}}, amount, random);
    }
    model.set_frame({});
}

void add_bookcases(PatchModel& model, const Furnishing& amount, std::uint64_t seed) {
    Random random(seed, 2);
    for (const double s : {-1.0, 1.0})
        for (int i = 1; i < Hall::bays; i += amount.plain ? 3 : 1) {
            const Frame frame{{-Hall::half_length + Hall::bay * i, 0, s * (Hall::outer - 0.22)},
                              {s > 0 ? -1.0 : 1.0, 0.0}};
            model.set_frame(frame);
            model.add_box({-0.9, 0, -0.2}, {-0.86, 2.5, 0.2});
            model.add_box({0.86, 0, -0.2}, {0.9, 2.5, 0.2});
            model.add_quad({-0.9, 0, -0.19}, {0.9, 0, -0.19}, {0.9, 2.5, -0.19},
                           {-0.9, 2.5, -0.19});
            for (int shelf = 0; shelf <= 6; shelf += amount.plain ? 3 : 1) {
                const double y = 0.1 + 0.39 * shelf;
                model.set_frame(frame);
                model.add_box({-0.86, y - 0.03, -0.2}, {0.86, y, 0.2});
                double x = -0.84;
                for (int book = 0; book < amount.books && shelf < 6; ++book) {
                    // Upright: thickness along x, some leaning away.
                    const double thick = random.range(0.6, 1.4) * 1.6 / amount.books;
                    const double lean = book % 7 == 6 ? 0.04 : 0.0;
                    const double height = random.range(0.22, 0.33), depth = random.range(0.2, 0.3);
                    if (x + thick + lean > 0.84) break;
                    model.add_hexahedron({{x, y, 0.15 - depth},
                                          {x + 0.92 * thick, y, 0.15 - depth},
                                          {x + lean, y + height, 0.15 - depth},
                                          {x + lean + 0.92 * thick, y + height, 0.15 - depth},
                                          {x, y, 0.15},
                                          {x + 0.92 * thick, y, 0.15},
                                          {x + lean, y + height, 0.15},
                                          {x + lean + 0.92 * thick, y + height, 0.15}});
                    x += thick + lean;
                }
            }
            const Point top{0.5 * random.sign(), 2.44, 0};
            add_vase(model, inside(frame, top, random.unit()), 0.5, 12);
        }
    model.set_frame({});
}

void add_chandeliers(PatchModel& model, const Furnishing& amount) {
    for (const double x : {-6.0, 1.0, 8.0}) {
        const Frame frame{{x, 6.6, 0}, {1.0, 0.0}};
        model.set_frame(frame);
        add_turned(model,
                   {{{0.005, -0.5}, {0.3, -0.35}, {0.08, 0.0}},
                    {{0.08, 0.0}, {0.02, 0.3}, {0.15, 0.5}},
                    {{0.15, 0.5}, {0.02, 0.6}, {0.02, 0.9}}},
                   {10.0, 6, 2, 10, 0.1});
        add_ring(model, {0, 0.25, 0}, 1.1, 0.03, RingAxis::y, 5.0);
        for (int i = 0; i < amount.chandelier_arms; ++i) {
            const Circle c = circle(static_cast<double>(i) / amount.chandelier_arms);
            model.set_frame({frame.origin, c});
            add_tube(model,
                     [](double t) {
                         return Point{0.08 + 1.02 * t, 0.1 - 0.9 * t * (1.0 - t) + 0.2 * t, 0};
                     },
                     0.02, {0, 0, 1}, {3, 2.0}, {4, 10.0});
            model.set_frame(inside(model.frame(), {1.1, 0.3, 0}, 0.0));
            add_turned(model,
                       {{{0.005, -0.02}, {0.1, -0.02}, {0.09, 0.06}},
                        straight({0.02, 0.0}, {0.02, 0.18}),
                        {{0.005, 0.18}, {0.05, 0.22}, {0.001, 0.3}}},
                       {24.0, 4, 1, 0, 0.0});
        }
        // A chain up to the vault.
        model.set_frame({});
        const int links = amount.plain ? 0 : amount.chandelier_arms * 6;
        if (amount.plain) model.add_box({x - 0.02, 7.4, -0.02}, {x + 0.02, 16.0, 0.02});
        for (int i = 0; i < links; ++i) {
            const double y = mix(7.5, 15.9, (i + 0.5) / links), half = 0.6 * 8.4 / links;
            const bool across = i % 2 == 0;
            add_tube(model,
                     [=](double t) {
                         const Circle c = circle(t);
                         return Point{x + (across ? 0.06 * c.cos : 0.0), y + half * c.sin,
                                      across ? 0.0 : 0.06 * c.cos};
                     },
                     0.012, across ? Point{0, 0, 1} : Point{1, 0, 0}, {3, 0.6}, {6, 3.0});
        }
    }
}

void add_drapes(PatchModel& model, std::uint64_t seed) {
    for (const double s : {-1.0, 1.0})
        for (int i = 1; i < Hall::bays; i += 2) {
            const double x = -Hall::half_length + Hall::bay * (i + 0.5), z = s * (Hall::nave - 0.5);
            const double phase = i * 0.37 + s;
            model.add_patch(
                [=](double u, double v) {
                    // Gathered at the top, falling in folds, with a scalloped hem.
                    const double fold = circle(7.0 * u + phase).sin * (0.05 + 0.12 * (1.0 - v));
                    const double wrinkle = 0.05 * noise({9.0 * u, 2.0 * v, phase}, seed);
                    const double hem = 0.1 * circle(3.5 * u).sin * (1.0 - v);
                    const double width = 1.2 - 0.25 * v;
                    return Point{x + width * (2.0 * u - 1.0), mix(7.3 + hem * hem, 10.6, v),
                                 z - s * (fold + wrinkle)};
                },
                {14, 60.0}, {4, 50.0});
            add_tube(model,
                     [=](double t) {
                         return Point{x + mix(-1.5, 1.5, t), 10.6, z};
                     },
                     0.03, {0, 1, 0}, {4, 1.0}, {});
        }
}

void add_centerpiece(PatchModel& model, const Furnishing& amount, std::uint64_t seed) {
    const Frame frame{{12.6, 0, 0}, circle(0.5)};
    model.set_frame(frame);
    model.add_box({-1.1, 0, -1.1}, {1.1, 0.2, 1.1});
    model.add_box({-0.95, 0.2, -0.95}, {0.95, 0.35, 0.95});
    model.add_box({-0.85, 1.05, -0.85}, {0.85, 1.2, 0.85});
    add_turned(model,
               {{{0.9, 0.35}, {0.7, 0.4}, {0.72, 0.55}},
                straight({0.72, 0.55}, {0.72, 0.95}),
                {{0.72, 0.95}, {0.75, 1.02}, {0.85, 1.05}}},
               {6.0, 8, 1, 32, 0.04});
    if (amount.statue == 0) {
        add_vase(model, {{12.6, 1.2, 0}, circle(0.5)}, 1.6, 20);
    } else {
        // It looks down the nave.
        model.set_frame({{12.6, 1.22, 0}, circle(-0.25)});
        model.add_mesh(make_figure(amount.statue, seed).mesh, 1.5);
    }
    for (const double s : {-1.0, 1.0})
        for (const double x : {-12.0, 14.5})
            add_vase(model, {{x, 0, s * 3.6}, {1.0, 0.0}}, 1.3, 16);
    model.set_frame({});
}

}  // namespace raydix::builtin
