// Trees, leaves and grass of the scene `grove`. Boughs fork recursively and get thinner; leaves
// crowd around their tips, so that the boxes of neighbouring leaves overlap heavily.
#include <algorithm>
#include <cmath>

#include "exec/parallel.h"
#include "scene/grove.h"
#include "scene/patch_shapes.h"

namespace raydix::builtin {

namespace {

struct Bough {
    Point from, heading;
    double length, radius;
    int level;  // 0: trunk
};

/// Any direction at a right angle to `axis`, turned by `turns`.
Point sideways(Point axis, double turns) {
    const Point a = unit(cross(axis, std::abs(axis.y) < 0.9 ? Point{0, 1, 0} : Point{1, 0, 0}));
    const Point b = cross(axis, a);
    const Circle c = circle(turns);
    return a * c.cos + b * c.sin;
}

Point bough_point(const Bough& b, Point bend, double t) {
    return b.from + b.heading * (b.length * t) + bend * (b.length * t * t);
}

void add_bough(PatchModel& model, const Bough& b, Point bend, std::uint64_t seed) {
    const Point side = sideways(b.heading, 0.0), other = cross(b.heading, side);
    const double bark = b.level < 2 ? 0.12 : 0.0;
    model.add_patch(
        [=](double u, double v) {
            const Circle c = circle(u);
            const double flare = b.level == 0 ? 0.9 * (1.0 - v) * (1.0 - v) * (1.0 - v) : 0.0;
            const double rough =
                bark > 0.0 ? bark * noise({4.0 * c.cos, 6.0 * v * b.length, 4.0 * c.sin}, seed)
                           : 0.0;
            const double r = b.radius * (mix(1.0, 0.55, v) + flare) * (1.0 + rough);
            return bough_point(b, bend, v) + (side * c.cos + other * c.sin) * r;
        },
        {b.level < 2 ? 5u : 3u, 40.0 * b.radius}, {b.level == 0 ? 3u : 1u, 3.0 * b.length});
}

}  // namespace

std::vector<Tree> plant_trees(std::uint64_t count, std::uint64_t seed) {
    std::vector<Tree> trees;
    Random random(seed, 11);
    // Far enough apart to stand, near enough for the crowns to grow into each other; the clearing
    // stays free.
    const double root = std::sqrt(static_cast<double>(count));
    const double spread = std::min(0.92 * grove_half, 7.0 + 3.0 * root);
    const double apart = 1.2 * spread / root;
    for (int attempt = 0; trees.size() < count; ++attempt) {
        const double x = spread * random.sign(), z = spread * random.sign();
        const double least = attempt < 2000 ? apart : 0.0;
        bool free = x * x + z * z > 36.0;
        for (const Tree& t : trees) {
            const double dx = t.foot.x - x, dz = t.foot.z - z;
            free = free && dx * dx + dz * dz > least * least;
        }
        if (free)
            trees.push_back(
                {{x, ground(x, z, seed) - 0.15, z}, random.range(7.0, 13.0), random.bits()});
    }
    return trees;
}

std::vector<Twig> grow_tree(PatchModel& model, const Tree& tree, int levels) {
    std::vector<Twig> twigs;
    Random random(tree.seed);
    const Point lean = unit({0.12 * random.sign(), 1.0, 0.12 * random.sign()});
    std::vector<Bough> boughs{{tree.foot, lean, 0.45 * tree.height, 0.028 * tree.height, 0}};
    for (std::size_t i = 0; i < boughs.size(); ++i) {
        const Bough b = boughs[i];
        const Point bend =
            Point{random.sign(), 0.6 * random.unit(), random.sign()} * (b.level == 0 ? 0.06 : 0.2);
        add_bough(model, b, bend, tree.seed);
        const Point tip = bough_point(b, bend, 1.0);
        const Point heading = unit(tip - bough_point(b, bend, 0.9));
        if (b.level == levels) {
            twigs.push_back({bough_point(b, bend, 0.75), heading, 0.3 * b.length + 0.22});
            continue;
        }
        const int forks = b.level == 0 ? 5 : 3;
        const double turn = random.unit();
        for (int k = 0; k < forks; ++k) {
            const double at = b.level == 0 && k > 0 ? mix(0.6, 1.0, k / 4.0)
                                                    : (k == 0 ? 1.0 : random.range(0.5, 1.0));
            const double spread = k == 0 ? 0.25 : random.range(0.7, 1.1);
            const Point away =
                sideways(heading, turn + static_cast<double>(k) / forks + 0.05 * random.sign());
            boughs.push_back({bough_point(b, bend, at),
                              unit(heading + away * spread + Point{0, 0.15, 0}),
                              b.length * random.range(0.55, 0.75),
                              b.radius * (k == 0 ? 0.55 : 0.42), b.level + 1});
        }
    }
    return twigs;
}

void place_leaves(std::span<const Twig> twigs, double size, std::uint64_t seed,
                  std::span<Vec3> vertices, std::span<Triangle> triangles, std::uint32_t base) {
    const std::size_t leaves = triangles.size() / 2;
    for_each_index(leaves, [&](std::size_t i) {
        Random random(seed, i);
        // Eight leaves to a spray: they start close together and grow through each other.
        const std::size_t spray_index = i / 8;
        Random spray(seed + 4, spray_index);
        const Twig& twig = twigs[spray_index % twigs.size()];
        const double far = spray.unit();
        const Point stem = twig.at + spray.direction() * (twig.reach * far * (2.0 - far));
        const Point at = stem + random.direction() * (0.15 * size);
        const Point along = unit(random.direction() + twig.heading * 0.5 + Point{0, -0.4, 0});
        const Point across = sideways(along, random.unit());
        const Point lift = cross(along, across);
        const double length = size * random.range(0.7, 1.3), width = 0.35 * length;
        const Point corners[4] = {
            at, at + along * (0.45 * length) + across * width + lift * (0.15 * length),
            at + along * length,
            at + along * (0.45 * length) - across * width + lift * (0.15 * length)};
        for (std::size_t k = 0; k < 4; ++k) vertices[4 * i + k] = to_vec3(corners[k]);
        const auto v = base + static_cast<std::uint32_t>(4 * i);
        triangles[2 * i] = {v, v + 1, v + 2};
        triangles[2 * i + 1] = {v, v + 2, v + 3};
    });
}

void place_grass(double size, std::uint64_t seed, std::span<Vec3> vertices,
                 std::span<Triangle> triangles, std::uint32_t base) {
    const std::size_t blades = triangles.size() / 3;
    for_each_index(blades, [&](std::size_t i) {
        Random random(seed + 2, i);
        // Tufts of 16 blades, denser toward the clearing.
        Random tuft(seed + 3, i / 16);
        const Circle c = circle(tuft.unit());
        const double reach = 0.95 * grove_half * tuft.unit();
        const double x = reach * c.cos + 0.25 * random.sign(),
                     z = reach * c.sin + 0.25 * random.sign();
        const Point foot{x, ground(x, z, seed) - 0.01, z};
        const Circle face = circle(random.unit());
        const Point across = Point{face.cos, 0, face.sin} * (0.02 * size);
        const Point lean = Point{-face.sin, 0, face.cos} * (0.3 * size * random.unit());
        const double height = size * random.range(0.5, 1.0);
        const Point middle = foot + lean * 0.3 + Point{0, 0.6 * height, 0};
        const Point corners[5] = {foot - across, foot + across, middle - across * 0.7,
                                  middle + across * 0.7, foot + lean + Point{0, height, 0}};
        for (std::size_t k = 0; k < 5; ++k) vertices[5 * i + k] = to_vec3(corners[k]);
        const auto v = base + static_cast<std::uint32_t>(5 * i);
        triangles[3 * i] = {v, v + 1, v + 3};
        triangles[3 * i + 1] = {v, v + 3, v + 2};
        triangles[3 * i + 2] = {v + 2, v + 3, v + 4};
    });
}

}  // namespace raydix::builtin
