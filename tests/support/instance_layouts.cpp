#include "support/instance_layouts.h"

#include <functional>
#include <stdexcept>

#include "support/digest_inputs.h"
#include "support/double_scenes.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t instance_layouts_seed = 20140704;

using Rows3 = std::array<std::array<double, 3>, 3>;

Rows3 product(const Rows3& a, const Rows3& b) {
    Rows3 out{};
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j)
            out[i][j] = (a[i][0] * b[0][j] + a[i][1] * b[1][j]) + a[i][2] * b[2][j];
    return out;
}

Rows3 diagonal(double x, double y, double z) { return {{{x, 0, 0}, {0, y, 0}, {0, 0, z}}}; }

MapRows placed(const Rows3& m, Vec3d at) {
    return {{{m[0][0], m[0][1], m[0][2], at.x},
             {m[1][0], m[1][1], m[1][2], at.y},
             {m[2][0], m[2][1], m[2][2], at.z}}};
}

/// One call after the other, never two as arguments of a third, whose order compilers choose.
class MapMaker {
public:
    explicit MapMaker(std::uint64_t start) : random_(start) {}

    /// The turn of a quaternion of small whole numbers.
    Rows3 turn() {
        const double a = whole(3), b = whole(3), c = whole(3), d = whole(3);
        const double n = a * a + b * b + c * c + d * d;
        if (n == 0.0) return turn();
        return {{{(a * a + b * b - c * c - d * d) / n, 2 * (b * c - a * d) / n,
                  2 * (b * d + a * c) / n},
                 {2 * (b * c + a * d) / n, (a * a - b * b + c * c - d * d) / n,
                  2 * (c * d - a * b) / n},
                 {2 * (b * d - a * c) / n, 2 * (c * d + a * b) / n,
                  (a * a - b * b - c * c + d * d) / n}}};
    }
    Rows3 stretch() {
        const Rows3 before = turn(), after = turn();
        const double x = stretched_by(), y = stretched_by(), z = stretched_by();
        return product(product(after, diagonal(x, y, z)), before);
    }
    Rows3 shear() {
        Rows3 rows = diagonal(1, 1, 1);
        const std::size_t axis = random_.below(2);
        rows[axis][2] = whole(8);
        rows[1][0] = 0.5 * whole(8);
        return product(turn(), rows);
    }
    Rows3 mirror() {
        const double x = random_.below(2) != 0 ? 1 : -1, y = random_.below(2) != 0 ? 1 : -1;
        return product(turn(), diagonal(x, y, -1));
    }
    /// Any of these.
    Rows3 any() {
        switch (random_.below(4)) {
            case 0:
                return turn();
            case 1:
                return stretch();
            case 2:
                return shear();
            default:
                return mirror();
        }
    }
    /// Whole numbers alone: what it maps keeps every bit.
    MapRows exact() {
        constexpr Rows3 turns[] = {{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
                                   {{{0, -1, 0}, {1, 0, 0}, {0, 0, 1}}},
                                   {{{-1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
                                   {{{0, 0, 1}, {0, 2, 0}, {-1, 0, 0}}}};
        const Rows3& turned = turns[random_.below(4)];
        const double x = whole(2), y = whole(2), z = whole(2);
        return placed(turned, {x, y, z});
    }

    /// -most to most.
    double whole(std::size_t most) {
        return static_cast<double>(random_.below(2 * most + 1)) - static_cast<double>(most);
    }
    std::size_t below(std::size_t n) { return random_.below(n); }
    Vec3d in_cube(double reach) {
        return random_.in({{-reach, -reach, -reach}, {reach, reach, reach}});
    }

private:
    /// 1/8 to 8.
    double stretched_by() {
        constexpr double powers[] = {0.125, 0.25, 0.5, 1, 2, 4};
        const double power = powers[random_.below(6)];
        return power * random_.between(1, 2);
    }
    RandomD random_;
};

/// About 1 in size: a scan, thinned, with triangles from small to large; a soup; whole numbers,
/// whose triangles meet in planes and have hits at equal t.
std::vector<MeshD> small_meshes() {
    return {in_double(small_builtin("builtin:figure?triangles=10000")),
            in_double(random_soup(300, instance_layouts_seed, 0.5f)),
            in_double(lattice_mesh(150, 3, instance_layouts_seed), 0.5)};
}

/// 4 x 4 x 4 places, each with a map of its own.
Layout grid(Vec3d middle, double step, const std::function<Rows3(MapMaker&)>& map) {
    Layout layout{small_meshes()};
    MapMaker maker(instance_layouts_seed);
    for (std::size_t i = 0; i < 64; ++i) {
        const Vec3d cell{static_cast<double>(i % 4), static_cast<double>(i / 4 % 4),
                         static_cast<double>(i / 16)};
        const Rows3 rows = map(maker);
        const Vec3d at = middle + step * cell + maker.in_cube(0.3 * step);
        layout.groups[0].push_back({false, i % 3, placed(rows, at)});
    }
    return layout;
}

/// The same things at the same places, alone and through groups, so that whole instances tie.
Layout ties() {
    Layout layout{small_meshes()};
    layout.groups.resize(3);
    MapMaker maker(instance_layouts_seed);
    const std::size_t meshes[] = {2, 2, 0};
    for (std::size_t i = 0; i < 6; ++i)
        layout.groups[2].push_back({false, meshes[i % 3], maker.exact()});
    layout.groups[1] = layout.groups[2];
    layout.groups[1].insert(layout.groups[1].begin() + 2, Placed{true, 2});
    for (std::size_t i = 0; i < 12; ++i)
        layout.groups[0].push_back({false, meshes[i % 3], maker.exact()});
    layout.groups[0].push_back({true, 1});
    layout.groups[0].push_back(layout.groups[0][3]);
    layout.groups[0].push_back({true, 2, maker.exact()});
    layout.groups[0].push_back(layout.groups[0].back());
    layout.groups[0].insert(layout.groups[0].begin(), Placed{true, 2});
    return layout;
}

/// Three levels of meshes and groups; with masks, each instance has one of its own.
Layout nested(bool masks) {
    Layout layout{small_meshes(), {}, masks};
    layout.groups.resize(3);
    MapMaker maker(instance_layouts_seed);
    const auto mask = [&](std::size_t i) {
        return masks && i % 3 != 0 ? std::uint32_t{3} << maker.below(3) : 0xFFFFFFFFu;
    };
    const auto add = [&](std::size_t group, bool shows_group, std::size_t what, double reach) {
        const Rows3 rows = maker.any();
        const Vec3d at = maker.in_cube(reach);
        const std::uint32_t seen_by = mask(layout.groups[group].size());
        layout.groups[group].push_back({shows_group, what, placed(rows, at), seen_by});
    };
    for (std::size_t i = 0; i < 4; ++i) add(2, false, i % 3, 3);
    for (std::size_t i = 0; i < 5; ++i) add(1, i % 2 == 1, i % 2 == 1 ? 2 : i % 3, 5);
    for (std::size_t i = 0; i < 9; ++i) add(0, i % 3 != 0, i % 3 != 0 ? i % 3 : i / 3, 20);
    return layout;
}

/// Eight levels; each shows a mesh and, but for the last, the next level.
Layout deep() {
    constexpr std::size_t levels = 8;
    Layout layout{small_meshes()};
    layout.groups.resize(levels);
    MapMaker maker(instance_layouts_seed);
    for (std::size_t k = 0; k < levels; ++k) {
        const Rows3 rows = k % 2 == 0 ? maker.turn() : maker.mirror();
        const Vec3d at = maker.in_cube(1.5);
        layout.groups[k].push_back({false, k % 3, placed(rows, at)});
        if (k + 1 == levels) break;
        const Rows3 next = maker.turn();
        const Vec3d beside = maker.in_cube(1);
        layout.groups[k].push_back({true, k + 1, placed(next, beside)});
    }
    return layout;
}

Vec3d mapped(const MapRows& m, Vec3d p) {
    const auto row = [&](std::size_t i) {
        return ((m[i][0] * p.x + m[i][1] * p.y) + m[i][2] * p.z) + m[i][3];
    };
    return {row(0), row(1), row(2)};
}

/// Squares and boxes far from their own 0, placed side by side: rays that go in are rounded to what
/// floats can tell there, which decides at the sides, and boxes of instances must have room for it.
Layout offset() {
    constexpr Vec3d middle{3000, -2000, 1000};
    std::vector<Vec3d> corners;
    for (const double z : {-1.0, 1.0})
        for (const double y : {-1.0, 1.0})
            for (const double x : {-1.0, 1.0}) corners.push_back(middle + Vec3d{x, y, z});
    const std::vector<Triangle> square{{0, 1, 3}, {0, 3, 2}};
    std::vector<Triangle> cube = square;
    for (const Triangle& t :
         {Triangle{4, 7, 5}, Triangle{4, 6, 7}, Triangle{0, 5, 1}, Triangle{0, 4, 5},
          Triangle{2, 3, 7}, Triangle{2, 7, 6}, Triangle{0, 2, 6}, Triangle{0, 6, 4},
          Triangle{1, 5, 7}, Triangle{1, 7, 3}})
        cube.push_back(t);
    Layout layout{{{"", corners, square}, {"", corners, cube}}};
    MapMaker maker(instance_layouts_seed);
    for (std::size_t i = 0; i < 32; ++i) {
        const Rows3 rows = i % 4 == 0 ? diagonal(1, 1, 1) : maker.turn();
        const Vec3d at = maker.in_cube(8);
        layout.groups[0].push_back(
            {false, i % 2, placed(rows, at - mapped(placed(rows, {0, 0, 0}), middle))});
    }
    return layout;
}

}  // namespace

std::vector<ShownMesh> shown_meshes(const Layout& layout) {
    std::vector<ShownMesh> all;
    std::uint32_t number = 0;
    const std::function<void(std::size_t, const ShownMesh&)> show = [&](std::size_t group,
                                                                        const ShownMesh& so_far) {
        for (std::uint32_t i = 0; i < layout.groups[group].size(); ++i) {
            const Placed& instance = layout.groups[group][i];
            ShownMesh next = so_far;
            next.path.push_back(i);
            next.way.push_back(&instance);
            next.number = ++number;
            if (instance.group) {
                show(instance.what, next);
            } else {
                next.mesh = instance.what;
                all.push_back(std::move(next));
            }
        }
    };
    show(0, {});
    return all;
}

MeshD some_triangles(const Layout& layout, std::size_t count) {
    MeshD out;
    for (const ShownMesh& shown : shown_meshes(layout)) {
        const MeshD& mesh = layout.meshes[shown.mesh];
        for (std::size_t i = 0; i < count; ++i) {
            const auto first = static_cast<std::uint32_t>(out.vertices.size());
            const std::size_t chosen = i * mesh.triangles.size() / count;
            for (const std::uint32_t corner : mesh.triangles[chosen]) {
                Vec3d p = mesh.vertices[corner];
                for (std::size_t k = shown.way.size(); k-- > 0;) p = mapped(shown.way[k]->rows, p);
                out.vertices.push_back(p);
            }
            out.triangles.push_back({first, first + 1, first + 2});
        }
    }
    return out;
}

Layout layout_named(const std::string& name) {
    if (name == "grid") return grid({0, 0, 0}, 2, [](MapMaker& m) { return m.turn(); });
    if (name == "far") return grid(utm_place, 2, [](MapMaker& m) { return m.turn(); });
    if (name == "mirrored") return grid({0, 0, 0}, 2, [](MapMaker& m) { return m.mirror(); });
    if (name == "stretched") return grid({0, 0, 0}, 3, [](MapMaker& m) { return m.stretch(); });
    if (name == "sheared") return grid({0, 0, 0}, 3, [](MapMaker& m) { return m.shear(); });
    if (name == "ties") return ties();
    if (name == "nested") return nested(false);
    if (name == "masks") return nested(true);
    if (name == "deep") return deep();
    if (name == "offset") return offset();
    throw std::invalid_argument("no layout " + name);
}

}  // namespace raydix::test
