#include "scene_contents.h"

#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/rays.h>

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "scene/builtin_math.h"
#include "scene/grove.h"

namespace raydix::bench {
namespace {

using builtin::Circle;
using builtin::Point;
using builtin::Random;

/// In double; rounded once, when a placement is made of it.
struct Map {
    std::array<double, 12> m{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

    static Map of(const Affine& a) {
        Map map;
        std::copy(a.begin(), a.end(), map.m.begin());
        return map;
    }
    static Map moved(Point by) { return {{1, 0, 0, by.x, 0, 1, 0, by.y, 0, 0, 1, by.z}}; }
    static Map scaled(double s) { return {{s, 0, 0, 0, 0, s, 0, 0, 0, 0, s, 0}}; }
    static Map turned_about_y(double turns) {
        const Circle c = builtin::circle(turns);
        return {{c.cos, 0, c.sin, 0, 0, 1, 0, 0, -c.sin, 0, c.cos, 0}};
    }
    /// Evenly over all rotations: three numbers from [0, 1) (Shoemake 1992).
    static Map turned(double a, double b, double c) {
        const Circle around = builtin::circle(b), about = builtin::circle(c);
        const double s = std::sqrt(1.0 - a), r = std::sqrt(a);
        const double x = s * around.sin, y = s * around.cos, z = r * about.sin, w = r * about.cos;
        return {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), 0,
                 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), 0,
                 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), 0}};
    }
    /// This one after `first`.
    [[nodiscard]] Map after(const Map& first) const {
        Map result;
        for (std::size_t r = 0; r < 3; ++r)
            for (std::size_t c = 0; c < 4; ++c) {
                double sum = c == 3 ? m[4 * r + 3] : 0.0;
                for (std::size_t k = 0; k < 3; ++k) sum += m[4 * r + k] * first.m[4 * k + c];
                result.m[4 * r + c] = sum;
            }
        return result;
    }
    [[nodiscard]] Point operator()(Point p) const {
        const auto row = [&](std::size_t r) {
            return m[4 * r] * p.x + m[4 * r + 1] * p.y + m[4 * r + 2] * p.z + m[4 * r + 3];
        };
        return {row(0), row(1), row(2)};
    }
    [[nodiscard]] Affine rounded() const {
        Affine a{};
        std::transform(m.begin(), m.end(), a.begin(), [](double x) { return float(x); });
        return a;
    }
};

Point point_of(Vec3 p) { return {p.x, p.y, p.z}; }
Point extent_of(const Aabb& box) { return point_of(box.hi) - point_of(box.lo); }
Point middle_of(const Aabb& box) { return 0.5 * (point_of(box.lo) + point_of(box.hi)); }

void grow(Aabb& box, Vec3 p) { box = {min_of(box.lo, p), max_of(box.hi, p)}; }

Aabb image_of(const Aabb& box, const Map& map) {
    Aabb image = empty_box();
    for (int corner = 0; corner < 8; ++corner)
        grow(image, builtin::to_vec3(
                        map({corner & 1 ? box.hi.x : box.lo.x, corner & 2 ? box.hi.y : box.lo.y,
                             corner & 4 ? box.hi.z : box.lo.z})));
    return image;
}

/// Maps that put copies of a thing in `box` on a grid as near to a cube as it goes. `apart`: how
/// far its cells are apart, in diagonals of the box.
std::vector<Affine> places_on_grid(const Aabb& box, std::uint64_t count, double apart,
                                   Random& random) {
    const auto side = static_cast<std::uint64_t>(std::ceil(std::cbrt(double(count))));
    const double cell = apart * builtin::length(extent_of(box));
    std::vector<Affine> places;
    for (std::uint64_t i = 0; i < count; ++i) {
        const double jx = random.sign(), jy = random.sign(), jz = random.sign();
        const Point at{double(i % side) + 0.3 * jx, double(i / side % side) + 0.3 * jy,
                       double(i / side / side) + 0.3 * jz};
        const double a = random.unit(), b = random.unit(), c = random.unit(),
                     size = random.range(0.5, 1.5);
        places.push_back(Map::moved(cell * at)
                             .after(Map::turned(a, b, c))
                             .after(Map::scaled(size))
                             .after(Map::moved(-1.0 * middle_of(box)))
                             .rounded());
    }
    return places;
}

void collect_leaves(const PlacedScene& scene, std::uint32_t group, const Map& to_world,
                    std::vector<PlacedLeaf>& leaves) {
    for (const Placement& placement : scene.groups[group]) {
        const Map map = to_world.after(Map::of(placement.to_parent));
        if (placement.is_group)
            collect_leaves(scene, placement.thing, map, leaves);
        else
            leaves.push_back({placement.thing, map.rounded()});
    }
}

SharedMesh with_room(Mesh mesh) {
    mesh.vertices.reserve(mesh.vertices.size() + 1);
    return std::make_shared<Mesh>(std::move(mesh));
}

}  // namespace

std::vector<PlacedLeaf> leaves_of(const PlacedScene& scene, std::uint32_t group) {
    std::vector<PlacedLeaf> leaves;
    collect_leaves(scene, group, {}, leaves);
    return leaves;
}

std::vector<std::vector<std::uint32_t>> first_leaves_of(const PlacedScene& scene) {
    std::vector<std::vector<std::uint32_t>> first(scene.groups.size());
    for (std::size_t g = scene.groups.size(); g-- > 0;) {
        std::uint32_t sum = 0;
        for (const Placement& placement : scene.groups[g]) {
            first[g].push_back(sum);
            sum += placement.is_group ? first[placement.thing].back() : 1;
        }
        first[g].push_back(sum);
    }
    return first;
}

Aabb bounds_of(const Mesh& mesh) { return inspect(mesh).bounds; }

Aabb bounds_of(const PlacedScene& scene, std::uint32_t group) {
    std::vector<Aabb> boxes;
    for (const SharedMesh& mesh : scene.meshes) boxes.push_back(bounds_of(*mesh));
    Aabb box = empty_box();
    for (const PlacedLeaf& leaf : leaves_of(scene, group))
        box = unite(box, image_of(boxes[leaf.mesh], Map::of(leaf.to_world)));
    return box;
}

SharedMesh load_shared_mesh(const std::string& scene, std::uint64_t seed) {
    Model loaded = load_flat_model(scene, seed);
    loaded.mesh().name = loaded.name;
    return with_room(std::move(loaded).mesh());
}

SharedMesh make_plant(std::uint64_t triangles, std::uint64_t seed) {
    builtin::PatchModel model(0.7);
    const auto twigs = builtin::grow_tree(model, {.foot = {}, .height = 6.0, .seed = seed}, 2);
    Mesh mesh = model.tessellate(triangles / 3);
    const std::size_t wood = mesh.triangles.size(), corners = mesh.vertices.size();
    const std::uint64_t leaves = (triangles - std::min<std::uint64_t>(triangles, wood)) / 2;
    mesh.vertices.resize(corners + 4 * leaves);
    mesh.triangles.resize(wood + 2 * leaves);
    builtin::place_leaves(twigs, 0.5, seed, std::span(mesh.vertices).subspan(corners),
                          std::span(mesh.triangles).subspan(wood),
                          static_cast<std::uint32_t>(corners));
    return with_room(std::move(mesh));
}

PlacedScene make_instances(const SharedMesh& mesh, std::uint64_t count, std::uint64_t seed) {
    Random random(seed, 1);
    PlacedScene scene{{mesh}, {{}}};
    for (const Affine& place : places_on_grid(bounds_of(*mesh), count, 0.8, random))
        scene.groups[0].push_back({.to_parent = place});
    return scene;
}

PlacedScene make_plants(const SharedMesh& plant, std::uint64_t count, std::uint64_t seed) {
    Random random(seed, 2);
    const Point size = extent_of(bounds_of(*plant));
    const double side = 0.35 * std::max(size.x, size.z) * std::sqrt(double(count));
    PlacedScene scene{{plant}, {{}}};
    for (std::uint64_t i = 0; i < count; ++i) {
        const double x = random.range(0.0, side), z = random.range(0.0, side);
        const double turn = random.unit(), scale = random.range(0.6, 1.3);
        const Point foot{x, builtin::ground(x, z, seed), z};
        scene.groups[0].push_back({.to_parent = Map::moved(foot)
                                                    .after(Map::turned_about_y(turn))
                                                    .after(Map::scaled(scale))
                                                    .rounded()});
    }
    return scene;
}

PlacedScene make_nested(const SharedMesh& mesh, std::uint64_t count, std::uint64_t seed) {
    constexpr std::uint32_t levels = 3;
    Random random(seed, 3);
    const auto of_a_level = static_cast<std::uint64_t>(std::lround(std::cbrt(double(count))));
    PlacedScene scene{{mesh}, std::vector<std::vector<Placement>>(levels)};
    for (std::uint32_t g = levels; g-- > 0;) {
        const bool last = g + 1 == levels;
        const Aabb box = last ? bounds_of(*mesh) : bounds_of(scene, g + 1);
        for (const Affine& place : places_on_grid(box, of_a_level, last ? 0.8 : 0.4, random))
            scene.groups[g].push_back({last ? 0 : g + 1, !last, place});
    }
    return scene;
}

std::vector<SharedMesh> make_pieces(std::uint64_t count, std::uint64_t triangles,
                                    std::uint64_t seed) {
    const SharedMesh one =
        load_shared_mesh("builtin:figure?triangles=" + std::to_string(triangles), seed);
    std::vector<SharedMesh> pieces;
    for (const PlacedLeaf& leaf : leaves_of(make_instances(one, count, seed))) {
        Mesh piece = *one;
        for (Vec3& v : piece.vertices) v = builtin::to_vec3(Map::of(leaf.to_world)(point_of(v)));
        pieces.push_back(with_room(std::move(piece)));
    }
    return pieces;
}

SharedMesh merged(const std::vector<SharedMesh>& pieces) {
    Mesh all;
    for (const SharedMesh& piece : pieces) {
        const auto base = static_cast<std::uint32_t>(all.vertices.size());
        all.vertices.insert(all.vertices.end(), piece->vertices.begin(), piece->vertices.end());
        for (const Triangle& t : piece->triangles)
            all.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
    }
    return with_room(std::move(all));
}

std::vector<Sphere> make_spheres(std::uint64_t count, std::uint64_t seed) {
    Random random(seed, 4);
    const auto apart = static_cast<float>(1.0 / std::cbrt(double(count)));
    std::vector<Sphere> spheres;
    for (std::uint64_t i = 0; i < count; ++i) {
        const double x = random.unit(), y = random.unit(), z = random.unit(),
                     radius = random.range(0.05, 0.45);
        spheres.push_back({builtin::to_vec3({x, y, z}), apart * static_cast<float>(radius)});
    }
    return spheres;
}

std::vector<Sphere> spheres_around(const std::vector<Vec3>& points) {
    Aabb box = empty_box();
    for (const Vec3 p : points) grow(box, p);
    const auto radius = static_cast<float>(0.25 * builtin::length(extent_of(box)) /
                                           std::sqrt(double(points.size())));
    std::vector<Sphere> spheres;
    for (const Vec3 p : points) spheres.push_back({p, radius});
    return spheres;
}

std::vector<Disc> make_discs(std::uint64_t count, std::uint64_t seed) {
    Random random(seed, 5);
    const auto apart = static_cast<float>(1.0 / std::cbrt(double(count)));
    std::vector<Disc> discs;
    for (std::uint64_t i = 0; i < count; ++i) {
        const double x = random.unit(), y = random.unit(), z = random.unit(),
                     radius = random.range(0.1, 0.6);
        const Point normal = random.direction();
        discs.push_back({builtin::to_vec3({x, y, z}), builtin::to_vec3(normal),
                         apart * static_cast<float>(radius)});
    }
    return discs;
}

std::vector<RayKindOf> make_rays(const Aabb& box, cli::Size size, std::uint64_t seed) {
    Random random(seed, 6);
    const Point center = middle_of(box), extent = extent_of(box);
    const auto within = [&](double part) {
        const double x = random.sign(), y = random.sign(), z = random.sign();
        return center + Point{0.5 * part * x * extent.x, 0.5 * part * y * extent.y,
                              0.5 * part * z * extent.z};
    };
    const auto picture = [&](Point from, Point to) {
        Camera camera;
        camera.position = builtin::to_vec3(from);
        camera.target = builtin::to_vec3(to);
        return make_primary_rays(camera, size.width, size.height);
    };
    Point out = random.direction();
    out.y = 0.2 + 0.6 * std::abs(out.y);
    RayKindOf primary{"primary", {}};
    primary.launches.push_back(picture(center + 0.9 * builtin::length(extent) * out, center));
    const Point inside = within(0.6), target = within(1.0);
    primary.launches.push_back(picture(inside, target));

    RayKindOf everywhere{"random", {{}}};
    for (std::size_t i = 0; i < std::size_t{size.width} * size.height; ++i) {
        const Point origin = within(1.0), direction = random.direction();
        everywhere.launches[0].push_back(
            {.origin = builtin::to_vec3(origin), .direction = builtin::to_vec3(direction)});
    }
    return {primary, everywhere};
}

}  // namespace raydix::bench
