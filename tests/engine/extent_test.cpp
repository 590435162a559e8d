// How far rays may miss what they hit through instances in instances: bounds hold, and are small
// where the maps together are harmless.
#include "engine/extent.h"

#include <gtest/gtest.h>
#include <raydix/error.h>

#include <cmath>
#include <iostream>
#include <memory>
#include <utility>
#include <vector>

#include "engine/float_world.h"
#include "engine/long_double_maps.h"
#include "engine/scene_state.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t extent_seed = 41;
constexpr double error_of_meshes = 0x1p-18, error_of_shapes = 0x1p-44;

Transform rounded(const Matrix& m) {
    Transform t;
    for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 4; ++c) t.m[r][c] = static_cast<float>(m[r][c]);
    return t;
}

class RandomMaps : public RandomScenes {
public:
    using RandomScenes::RandomScenes;

    Matrix turn(Real angle) {
        const Column a = test::unit({between(-1, 1), between(-1, 1), between(-1, 1)});
        const Real c = std::cos(angle), s = std::sin(angle), o = 1 - c;
        return {{{c + a[0] * a[0] * o, a[0] * a[1] * o - a[2] * s, a[0] * a[2] * o + a[1] * s, 0},
                 {a[1] * a[0] * o + a[2] * s, c + a[1] * a[1] * o, a[1] * a[2] * o - a[0] * s, 0},
                 {a[2] * a[0] * o - a[1] * s, a[2] * a[1] * o + a[0] * s, c + a[2] * a[2] * o, 0}}};
    }
    Matrix stretch(int most_exponent) {
        const auto factor = [&] {
            return std::ldexp(
                Real(1),
                static_cast<int>(below(static_cast<std::uint32_t>(2 * most_exponent + 1))) -
                    most_exponent);
        };
        return {{{factor(), 0, 0, 0}, {0, factor(), 0, 0}, {0, 0, factor(), 0}}};
    }
    Matrix moved(Matrix m, float by) {
        for (auto& row : m) row[3] = between(-by, by);
        return m;
    }
};

Matrix inverse_of_columns(const Matrix& m) {
    const Matrix none{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    Matrix out = none;
    const LongMap map(rounded(m));
    for (std::size_t r = 0; r < 3; ++r) {
        Column axis{};
        axis[r] = 1;
        const Column row = map.inverse_transpose(axis);
        for (std::size_t c = 0; c < 3; ++c) out[r][c] = row[c];
    }
    return out;
}

/// Maps from the outside inward. Turns and even scales; or stretches which later ones take back.
std::vector<Transform> random_chain(RandomMaps& random) {
    const std::uint32_t kind = random.below(4), levels = 2 + random.below(11);
    std::vector<Transform> chain;
    Matrix taken_back{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    while (chain.size() < levels) {
        Matrix m = random.turn(random.between(0, 3));
        if (kind == 1) m = composed(m, random.stretch(1));
        if (kind >= 2) {
            // Level by level what the one before it did and the opposite, turned in between.
            if (chain.size() % 2 == 0) {
                m = composed(composed(m, random.stretch(kind == 2 ? 3 : 6)), random.turn(1));
                taken_back = inverse_of_columns(m);
            } else {
                m = taken_back;
            }
        }
        chain.push_back(rounded(random.moved(m, random.below(2) == 0 ? 1.0f : 1e4f)));
    }
    return chain;
}

Real largest(const Column& v) {
    return std::max({std::fabs(v[0]), std::fabs(v[1]), std::fabs(v[2])});
}
/// The greatest distance, by components, to a point of a box.
Real farthest(const Column& from, const Column& lo, const Column& hi) {
    return std::max(largest(minus(hi, from)), largest(minus(from, lo)));
}
Column on_line(const WideRayLine& line, Real t) {
    Column p = column(line.origin);
    const Column d = column(line.direction);
    for (std::size_t k = 0; k < 3; ++k) p[k] += t * d[k];
    return p;
}

/// A line goes inward as rays do. Its point inside, moved by what a hit may be off there, and
/// mapped outward without rounding, is as near to the line outside as the image says.
TEST(Extent, ErrorsOfChainsAreHeld) {
    RandomMaps random(extent_seed);
    std::size_t by_product = 0;
    double tightest = 0;
    for (std::size_t i = 0; i < 500 * thorough; ++i) {
        const std::vector<Transform> chain = random_chain(random);
        const float size = std::ldexp(1.0f, static_cast<int>(random.below(20)) - 10);
        const Vec3 middle{random.between(-1, 1), random.between(-100, 100), 0};
        const double innermost = i % 2 == 0 ? error_of_meshes : error_of_shapes;
        const Extent inner{{middle + Vec3{-size, -size, 0}, middle + Vec3{size, size, size}},
                           innermost};
        Image image = image_of(inner);
        LongMap whole;
        double by_levels = innermost;
        for (auto t = chain.rbegin(); t != chain.rend(); ++t) {
            const Affine a = affine_of(*t);
            const MapErrors errors = errors_of(a, *inverse_of(a));
            image = image_of(a, errors, image, innermost);
            by_levels = errors.condition * by_levels + errors.rounding;
            whole = LongMap(*t).after(whole);
        }
        EXPECT_LE(image.error, by_levels);
        by_product += image.error < by_levels;
        if (!(image.error < 0x1p-6)) continue;  // rays look at all such parts

        // Outside: the box of the image's corners. Inside: a point of it.
        Column lo, hi;
        for (int corner = 0; corner < 8; ++corner) {
            const Column p = mapped(whole.m, {corner & 1 ? inner.box.lo.x : inner.box.hi.x,
                                              corner & 2 ? inner.box.lo.y : inner.box.hi.y,
                                              corner & 4 ? inner.box.lo.z : inner.box.hi.z});
            for (std::size_t k = 0; k < 3; ++k) {
                lo[k] = corner == 0 ? p[k] : std::min(lo[k], p[k]);
                hi[k] = corner == 0 ? p[k] : std::max(hi[k], p[k]);
            }
        }
        const Column target = mapped(whole.m, {random.between(inner.box.lo.x, inner.box.hi.x),
                                               random.between(inner.box.lo.y, inner.box.hi.y),
                                               random.between(inner.box.lo.z, inner.box.hi.z)});
        const Real away =
            std::ldexp(largest(minus(hi, lo)), static_cast<int>(random.below(24)) - 4);
        Ray ray;
        ray.origin = {static_cast<float>(target[0] + away * random.between(-1, 1)),
                      static_cast<float>(target[1] + away * random.between(-1, 1)),
                      static_cast<float>(target[2] + away * random.between(-1, 1))};
        const Column along = minus(target, column(ray.origin));
        ray.direction = {static_cast<float>(along[0]), static_cast<float>(along[1]),
                         static_cast<float>(along[2])};
        const WideRayLine outside{Double3(ray.origin), Double3(ray.direction)};
        WideRayLine inside = outside;
        for (const Transform& t : chain) inside = inside.into(*inverse_of(affine_of(t)));

        const Real d_inside =
            farthest(column(inside.origin), column(inner.box.lo), column(inner.box.hi));
        const Real d_outside = farthest(column(outside.origin), lo, hi);
        for (int corner = 0; corner < 8; ++corner) {
            Column p = on_line(inside, 1);
            const Real off = innermost * d_inside;
            for (std::size_t k = 0; k < 3; ++k) p[k] += (corner >> k & 1) != 0 ? off : -off;
            const Real miss = largest(minus(mapped(whole.m, p), on_line(outside, 1)));
            const Real room = image.error * d_outside + image.slack;
            ASSERT_LE(miss, room) << "case " << i << ", " << chain.size() << " levels";
            tightest = std::max(tightest, static_cast<double>(miss / room));
        }
    }
    std::cout << by_product << " by the product; up to " << tightest << " of the room\n";
    EXPECT_GT(by_product, 50 * thorough);
}

TransformD in_double(const Transform& t) {
    TransformD out;
    for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 4; ++c) out.m[r][c] = double{t.m[r][c]};
    return out;
}

/// The same in double: a point inside, mapped outward, is as near to the line as its image says.
TEST(Extent, ErrorsOfChainsAreHeldInDouble) {
    RandomMaps random(extent_seed);
    double tightest = 0;
    for (std::size_t i = 0; i < 300 * thorough; ++i) {
        const std::vector<Transform> chain = random_chain(random);
        const double size = std::ldexp(1.0, static_cast<int>(random.below(20)) - 10);
        const Vec3d from{random.between(-100, 100), random.between(-1, 1), 0};
        const ExtentD inner{{from, from + Vec3d{size, size, 0}}, i % 2 == 0 ? 0x1p-46 : 0.0};
        ImageD image(inner);
        LongMap whole;
        for (auto t = chain.rbegin(); t != chain.rend(); ++t) {
            const AffineD map = affine_of(in_double(*t));
            image.go_through(map, *inverse_of(map));
            whole = LongMap(*t).after(whole);
        }
        const Column target = mapped(whole.m, {inner.box.lo.x, inner.box.hi.y, 0});
        const ExtentD outer = image.extent(inner);
        for (std::size_t k = 0; k < 3; ++k) {
            EXPECT_GE(target[k], column(outer.box.lo)[k]);
            EXPECT_LE(target[k], column(outer.box.hi)[k]);
        }
        const Real away = std::ldexp(Real(size), static_cast<int>(random.below(30)) - 4);
        Vec3d origin, direction;
        const auto toward = [&](Real to, double& start, double& along) {
            start = static_cast<double>(to + away * random.between(-1, 1));
            along = static_cast<double>(to - start);
        };
        toward(target[0], origin.x, direction.x);
        toward(target[1], origin.y, direction.y);
        toward(target[2], origin.z, direction.z);
        LineD inside{Double3(origin), Double3(direction)};
        for (const Transform& t : chain) inside = inside.into(*inverse_of(affine_of(in_double(t))));
        Column outside = column(origin), p = column(inside.origin);
        const Real off = inner.error / 2 *  // errors are twice what is needed
                         farthest(p, column(inner.box.lo), column(inner.box.hi));
        for (std::size_t k = 0; k < 3; ++k) {
            outside[k] += column(direction)[k];
            p[k] += column(inside.direction)[k] + (random.below(2) == 0 ? off : -off);
        }
        const Real miss = largest(minus(mapped(whole.m, p), outside));
        const Real room =
            image.error * farthest(column(origin), column(outer.box.lo), column(outer.box.hi)) +
            image.slack;
        ASSERT_LE(miss, room) << "case " << i << ", " << chain.size() << " levels";
        tightest = std::max(tightest, static_cast<double>(miss / room));
    }
    std::cout << "up to " << tightest << " of the room\n";
}

/// Each level's box around a turned box would be larger by a half.
TEST(Extent, BoxesDoNotGrowByLevelsInDouble) {
    const double c = std::sqrt(0.5);
    const TransformD turn{{{{c, -c, 0, 0}, {c, c, 0, 0}, {0, 0, 1, 0}}}};
    SceneD scene(MeshD{"diamond",
                       {{5e11, 0, 0}, {0, 5e11, 0}, {-5e11, 0, 0}, {0, -5e11, 0}},
                       {{0, 1, 2}, {0, 2, 3}}});
    for (int level = 1; level <= 32; ++level) {
        SceneD outer;
        outer.add(scene, turn);
        outer.commit();
        const double reach = level % 2 == 0 ? 5e11 : 5e11 / c;
        EXPECT_NEAR(outer.bounds().hi.x, reach, 1e-6 * reach);
        EXPECT_NEAR(outer.bounds().lo.y, -reach, 1e-6 * reach);
        scene = std::move(outer);
    }
}

Mesh small_mesh(RandomScenes& random) { return random_soup(6, random.below(1000), 1.0f); }

/// `fan` copies a level, each placed by map_of(level, copy).
template <class MapOf>
std::shared_ptr<const World> nested_world(RandomScenes& random, std::uint32_t levels,
                                          std::uint32_t fan, const MapOf& map_of) {
    auto world = std::make_shared<World>();
    world->items.push_back({0, every_mask, small_mesh(random), {}, nullptr});
    world->scene.add(world->items[0].mesh);
    world->scene.commit();
    for (std::uint32_t level = 0; level < levels; ++level) {
        auto outer = std::make_shared<World>();
        for (std::uint32_t k = 0; k < fan; ++k) {
            outer->items.push_back({k, every_mask, {}, map_of(level, k), world});
            outer->scene.add(world->scene, outer->items.back().transform);
        }
        outer->scene.commit();
        world = outer;
    }
    return world;
}

/// Copies side by side, turned by 0.5.
auto turned_copies(RandomMaps& random) {
    return [&random](std::uint32_t level, std::uint32_t k) {
        Matrix m = random.turn(0.5);
        m[level % 3][3] = std::ldexp(Real(k == 0 ? 1.5 : -1.5), static_cast<int>(level / 2));
        return rounded(m);
    };
}
/// Halves along each axis in turn.
Transform half(std::uint32_t level, std::uint32_t k) {
    Transform t;
    t.m[level % 3][level % 3] = 0.5f;
    t.m[level % 3][3] = k == 0 ? 0.0f : 0.5f;
    return t;
}

/// The bounds need determinants above 2^-40 of the product of the rows' lengths.
TEST(Extent, MapsThatAreAlmostFlatAreRefused) {
    Mesh triangle;
    triangle.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    triangle.triangles = {{0, 1, 2}};
    const Scene inner(triangle);
    for (const float sign : {1.0f, -1.0f})
        for (const int exponent : {38, 39, 41, 44, 60}) {
            Transform map;
            map.m[2][0] = 0.6f, map.m[2][1] = 0.8f;  // a row of length 1
            map.m[2][2] = std::ldexp(sign, -exponent);
            Scene outer;
            bool refused = false;
            try {
                outer.add(inner, map);
            } catch (const InputError&) {
                refused = true;
            }
            EXPECT_EQ(refused, exponent > 40) << sign << " x 2^-" << exponent;
        }
}

/// The t of a ray from far away is rounded: its point lies before or behind the flat box.
TEST(Extent, HitsOfAMeshLieWithinItsOwn) {
    RandomMaps random(extent_seed);
    Mesh square;
    square.vertices = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
    square.triangles = {{0, 1, 2}, {0, 2, 3}};
    const Scene scene(square);
    const Extent extent = extent_of_mesh({{-1, -1, 0}, {1, 1, 0}});
    double farthest = 0;  // from the box, over the distance
    for (int k = 0; k < 5000; ++k) {
        const float distance = std::ldexp(1.0f, 2 + k % 20) * random.between(1, 2);
        const Vec3 to{random.between(-0.9f, 0.9f), random.between(-0.9f, 0.9f), 0};
        const Vec3 origin{random.between(-1, 1) * distance, random.between(-1, 1) * distance,
                          distance};
        const Vec3 way = (to - origin) * random.between(0.3f, 1);  // t is no round number
        const Hit hit = closest_hit(scene, {origin, 0, way, infinity});
        if (!hit.hit()) continue;  // the direction is rounded too
        const auto at = [&](float from, float along) {
            return double{from} + double{hit.t} * double{along};
        };
        const double p[3] = {at(origin.x, way.x), at(origin.y, way.y), at(origin.z, way.z)};
        double beside = 0;
        for (int axis = 0; axis < 3; ++axis)
            beside = std::max({beside, component(extent.box.lo, axis) - p[axis],
                               p[axis] - component(extent.box.hi, axis)});
        const double reach = double{distance} + 1;
        EXPECT_LE(beside, extent.error * reach) << "from " << distance;
        farthest = std::max(farthest, beside / reach);
    }
    EXPECT_GT(farthest, 0x1p-30) << "boxes need not widen for these rays";
}

/// Or every ray would visit them all.
TEST(Extent, HarmlessNestsHaveNoWildParts) {
    RandomMaps random(extent_seed);
    const std::uint32_t levels = thorough > 1 ? 14 : 9;
    const auto turned = nested_world(random, levels, 2, turned_copies(random));
    const auto halves = nested_world(random, levels, 2, half);
    for (const World* const world : {turned.get(), halves.get()}) {
        const SceneTree& tree = *SceneInternals::tree(world->scene);
        EXPECT_TRUE(tree.wild.part.empty()) << tree.wild.part.size() << " parts";
        EXPECT_EQ(tree.near.part.size(), std::size_t{1} << levels);
        for (const Extent& extent : tree.extents) EXPECT_LT(extent.error, 0x1p-14);
    }
}

/// Rays that begin near what they hit, or far away, beside a look at everything.
TEST(Extent, NestsLoseNoHit) {
    RandomMaps random(extent_seed);
    const auto turned = nested_world(random, 8, 2, turned_copies(random));
    const auto halves = nested_world(random, 8, 2, half);
    for (const World* const world : {turned.get(), halves.get()}) {
        // A corner of a triangle on any path.
        const auto corner = [&] {
            Double3 p;
            std::vector<Affine> maps;
            const World* at = world;
            for (; at->items[0].inside; at = at->items[0].inside.get())
                maps.push_back(affine_of(at->items[random.below(2)].transform));
            p = Double3(at->items[0].mesh.vertices[random.below(18)]);
            for (auto map = maps.rbegin(); map != maps.rend(); ++map) p = map->point(p);
            return p.rounded();
        };
        std::vector<Ray> rays(20 * thorough);
        for (Ray& ray : rays) {
            ray.origin = corner();
            const Vec3 a = corner(), b = corner();
            ray.direction = a + 0.01f * (b - a) - ray.origin;
        }
        // Once more from just before their hits, up to just behind them, and from far away.
        const std::vector<Hit> first =
            look(*world, rays, std::vector(rays.size(), every_mask)).hits;
        std::size_t hits = 0;
        for (std::size_t i = 0; i < first.size(); ++i) {
            if (!first[i].hit()) continue;
            ++hits;
            const Ray ray = rays[i];
            const float t = first[i].t;
            rays.push_back({ray.origin + t * ray.direction, 0, ray.direction, infinity});
            rays.push_back(
                {ray.origin + (0.9999f * t) * ray.direction, 0, ray.direction, 0.0001f * t});
            rays.push_back({ray.origin + (t - 100.0f) * ray.direction, 0, ray.direction, 100.0f});
        }
        EXPECT_GT(hits, 5 * thorough);
        const std::vector<Hit> expected =
            look(*world, rays, std::vector(rays.size(), every_mask)).hits;
        const std::vector<Hit> found = trace(world->scene, rays);
        for (std::size_t i = 0; i < rays.size(); ++i) {
            EXPECT_TRUE(same(found[i], expected[i])) << "ray " << i;
            EXPECT_TRUE(same(closest_hit(world->scene, rays[i]), expected[i])) << "ray " << i;
        }
    }
}

}  // namespace
}  // namespace raydix::test
