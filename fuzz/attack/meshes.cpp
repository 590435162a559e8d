// Families of meshes: random numbers -> vertices and triangles.
#include "attack/meshes.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numbers>

#include "attack/vectors.h"

namespace raydix::attack {
namespace {

constexpr float least_float = std::numeric_limits<float>::denorm_min();

Vec3 away(Random& random, Vec3 from, float size) { return from + random.cube() * size; }

void add_small(Random& random, Mesh& mesh, Vec3 center, float size) {
    add_triangle(mesh, away(random, center, size), away(random, center, size),
                 away(random, center, size));
}

void add_box(Mesh& mesh, Vec3 lo, Vec3 hi) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (std::uint32_t i = 0; i < 8; ++i)
        mesh.vertices.push_back({i & 1 ? hi.x : lo.x, i & 2 ? hi.y : lo.y, i & 4 ? hi.z : lo.z});
    constexpr std::array<Triangle, 12> faces{{{0, 2, 1},
                                              {1, 2, 3},
                                              {4, 5, 6},
                                              {5, 7, 6},
                                              {0, 1, 4},
                                              {1, 5, 4},
                                              {2, 6, 3},
                                              {3, 6, 7},
                                              {0, 4, 2},
                                              {2, 4, 6},
                                              {1, 3, 5},
                                              {3, 7, 5}}};
    for (const Triangle& f : faces)
        mesh.triangles.push_back({first + f[0], first + f[1], first + f[2]});
}

/// Any order of corners that makes a closed surface.
void add_tetrahedron(Mesh& mesh, const std::array<Vec3, 4>& corners) {
    const auto k = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), corners.begin(), corners.end());
    mesh.triangles.insert(
        mesh.triangles.end(),
        {{k, k + 2, k + 1}, {k, k + 1, k + 3}, {k + 1, k + 2, k + 3}, {k, k + 3, k + 2}});
}

Mesh make_needles(Random& random, std::uint32_t count) {
    Mesh mesh;
    const float length = random.power_of_ten(1, 7), width = random.chance(0.5) ? 1.0f : 0.1f;
    for (std::uint32_t i = 0; i < count; ++i) {
        const Vec3 from = random.cube();
        Vec3 along = random.cube();
        if (random.chance(0.5)) {
            along = {0, 0, 0};
            at(along, random.below(3)) = 1;
        }
        add_triangle(mesh, from, from + along * length, from + random.cube() * width);
    }
    return mesh;
}

Mesh make_coplanar(Random& random, std::uint32_t count) {
    Mesh mesh;
    for (std::uint32_t i = 0; i < count; ++i) {
        const std::uint32_t axis = random.below(3);
        const auto plane = static_cast<float>(random.whole(-1, 1));
        std::array<Vec3, 3> corners;
        for (Vec3& p : corners) {
            p = random.whole_point(3);
            at(p, axis) = plane;
        }
        add_triangle(mesh, corners[0], corners[1], corners[2]);
    }
    return mesh;
}

Mesh make_grid(Random& random, std::uint32_t count) {
    Mesh mesh;
    const auto side = std::max(1u, static_cast<std::uint32_t>(std::sqrt(count / 2.0)));
    const std::uint32_t axis = random.below(3);
    const float height = random.chance(0.5) ? 0.0f : random.sign_unit();
    const float step = random.chance(0.5) ? 1.0f : random.between(0.001f, 1000.0f);
    for (std::uint32_t j = 0; j <= side; ++j)
        for (std::uint32_t i = 0; i <= side; ++i) {
            Vec3 p{};
            at(p, axis) = height;
            at(p, (axis + 1) % 3) = static_cast<float>(i) * step;
            at(p, (axis + 2) % 3) = static_cast<float>(j) * step;
            mesh.vertices.push_back(p);
        }
    for (std::uint32_t j = 0; j < side; ++j)
        for (std::uint32_t i = 0; i < side; ++i) {
            const std::uint32_t a = j * (side + 1) + i, b = a + 1, c = a + side + 1, d = c + 1;
            mesh.triangles.push_back({a, b, c});
            mesh.triangles.push_back({b, d, c});
        }
    return mesh;
}

Mesh make_round(Random& random, std::uint32_t count, Vec3 radii) {
    const auto side = std::max(3u, static_cast<std::uint32_t>(std::sqrt(count / 2.0)));
    return make_sphere(side, std::max(2u, side), random.cube(), radii);
}

Mesh make_subnormal(Random& random, std::uint32_t count) {
    Mesh mesh;
    // Some meshes are all tiny, and all left out; in most one axis at least is not.
    const std::uint32_t ordinary = random.chance(0.9) ? random.below(3) : 3;
    const auto coordinate = [&](std::uint32_t axis) {
        if (axis == ordinary) return random.sign_unit();
        switch (random.below(4)) {
            case 0:
                return static_cast<float>(random.whole(-2, 2)) * least_float *
                       static_cast<float>(1u << random.below(20));
            case 1:
                return 0.0f;
            case 2:
                return random.sign_unit() * random.power_of_ten(-44, 0);
            default:
                return random.chance(0.3) ? random.sign_unit()
                                          : random.sign_unit() * random.power_of_ten(-44, -36);
        }
    };
    for (std::uint32_t i = 0; i < count; ++i) {
        std::array<Vec3, 3> corners;
        for (Vec3& p : corners) p = {coordinate(0), coordinate(1), coordinate(2)};
        add_triangle(mesh, corners[0], corners[1], corners[2]);
    }
    return mesh;
}

Mesh make_far(Random& random, std::uint32_t count) {
    Mesh mesh;
    const Vec3 place = random.cube() * 1e11f;
    const float size = random.power_of_ten(4, 11);
    for (std::uint32_t i = 0; i < count; ++i)
        add_small(random, mesh, away(random, place, size), size * 0.3f);
    return mesh;
}

Mesh make_duplicates(Random& random, std::uint32_t count) {
    const auto family = static_cast<Family>(random.below(std::size_t(Family::tiny_and_huge)));
    Mesh mesh = make_mesh(random, family, std::max(1u, count / 6)).mesh;
    const std::size_t different = mesh.triangles.size();
    while (mesh.triangles.size() < count && different != 0) {
        Triangle t = mesh.triangles[random.below(different)];
        if (random.chance(0.5)) t = {t[1], t[2], t[0]};
        if (random.chance(0.3)) t = {t[1], t[0], t[2]};
        mesh.triangles.push_back(t);
    }
    return mesh;
}

Mesh make_non_finite(Random& random, std::uint32_t count) {
    constexpr float bad[] = {std::numeric_limits<float>::quiet_NaN(),
                             infinity,
                             -infinity,
                             2e12f,
                             -1.1e12f,
                             3e38f,
                             -0.0f,
                             1e12f};
    const auto family = static_cast<Family>(random.below(std::size_t(Family::duplicates)));
    Mesh mesh = make_mesh(random, family, count).mesh;
    for (Vec3& p : mesh.vertices)
        if (random.chance(0.05)) at(p, random.below(3)) = random.one_of(bad);
    return mesh;
}

Mesh make_zero_area(Random& random, std::uint32_t count) {
    const auto family = static_cast<Family>(random.below(std::size_t(Family::duplicates)));
    Mesh mesh = make_mesh(random, family, count).mesh;
    for (Triangle& t : mesh.triangles) {
        if (random.chance(0.3))
            t = random.chance(0.5) ? Triangle{t[0], t[0], t[2]} : Triangle{t[0], t[0], t[0]};
        if (random.chance(0.1)) mesh.vertices[t[2]] = mesh.vertices[t[0]];
    }
    return mesh;
}

Mesh make_fan(Random& random, std::uint32_t count) {
    Mesh mesh;
    const std::uint32_t blades = std::max(3u, count);
    mesh.vertices.push_back(random.cube());
    for (std::uint32_t i = 0; i < blades; ++i) {
        const double angle = 2 * std::numbers::pi * i / blades;
        mesh.vertices.push_back({static_cast<float>(std::cos(angle)),
                                 static_cast<float>(std::sin(angle)),
                                 random.chance(0.5) ? 0.0f : random.sign_unit()});
    }
    for (std::uint32_t i = 0; i < blades; ++i)
        mesh.triangles.push_back({0, 1 + i, 1 + (i + 1) % blades});
    return mesh;
}

Mesh make_soup(Random& random, std::uint32_t count) {
    Mesh mesh;
    for (std::uint32_t i = 0; i < count; ++i)
        add_small(random, mesh, random.cube(), random.power_of_ten(-3, 0));
    return mesh;
}

Mesh make_voxels(Random& random, std::uint32_t count) {
    Mesh mesh;
    for (std::uint32_t i = 0; i < std::max(1u, count / 12); ++i) {
        const Vec3 lo = random.whole_point(2);
        add_box(mesh, lo,
                lo + Vec3{float(random.whole(1, 2)), float(random.whole(1, 2)),
                          float(random.whole(1, 2))});
    }
    return mesh;
}

Mesh make_tiny_and_huge(Random& random, std::uint32_t count) {
    Mesh mesh;
    for (std::uint32_t i = 0; i < count; ++i)
        add_small(random, mesh, random.cube(),
                  random.chance(0.3) ? random.power_of_ten(6, 11) : random.power_of_ten(-6, 0));
    return mesh;
}

Mesh make_stretched_sphere(Random& random, std::uint32_t count) {
    Vec3 radii{1, 1, 1};
    at(radii, random.below(3)) = random.power_of_ten(3, 7);
    return make_round(random, count, radii);
}

Mesh make_tetrahedra(Random& random, std::uint32_t count) {
    Mesh mesh;
    for (std::uint32_t i = 0; i < std::max(1u, count / 4); ++i)
        add_tetrahedron(mesh, {random.whole_point(4), random.whole_point(4), random.whole_point(4),
                               random.whole_point(4)});
    return mesh;
}

Mesh make_far_small(Random& random, std::uint32_t count) {
    Mesh mesh;
    const Vec3 place = random.cube() * 1e6f;
    for (std::uint32_t i = 0; i < count; ++i) add_small(random, mesh, place, 1);
    return mesh;
}

Mesh make_strays(Random& random, std::uint32_t count) {
    const auto family = static_cast<Family>(random.below(std::size_t(Family::tiny_and_huge)));
    Mesh mesh = make_mesh(random, family, count).mesh;
    const float far = random.power_of_ten(2, 11);
    for (std::size_t more = 1 + random.below(4); more > 0; --more) {
        if (random.chance(0.5)) {
            add_small(random, mesh, away(random, {0, 0, 0}, far), far * random.power_of_ten(-3, 0));
        } else {
            const Vec3 a = away(random, {0, 0, 0}, far), b = away(random, {0, 0, 0}, far);
            add_triangle(mesh, a, b, away(random, {0, 0, 0}, 1));
        }
    }
    return mesh;
}

using MakeFamily = Mesh (*)(Random&, std::uint32_t);
struct FamilyEntry {
    const char* name;
    MakeFamily make;
};
constexpr std::array<FamilyEntry, std::size_t(Family::count)> families{{
    {"soup", make_soup},
    {"needles", make_needles},
    {"integer_coplanar", make_coplanar},
    {"grid", make_grid},
    {"sphere",
     [](Random& r, std::uint32_t n) {
         return make_round(r, n, {1, r.chance(0.5) ? 1.0f : r.power_of_ten(-5, 0), 1});
     }},
    {"voxels", make_voxels},
    {"tiny_and_huge", make_tiny_and_huge},
    {"subnormal", make_subnormal},
    {"far_away", make_far},
    {"duplicates", make_duplicates},
    {"non_finite", make_non_finite},
    {"zero_area", make_zero_area},
    {"fan", make_fan},
    {"stretched_sphere", make_stretched_sphere},
    {"tetrahedra", make_tetrahedra},
    {"far_small", make_far_small},
    {"strays", make_strays},
}};

/// One axis 1 to 10^7 times as long, or down to subnormal numbers; or all axes scaled alike.
void deform(Random& random, Mesh& mesh) {
    Vec3 factors{1, 1, 1};
    switch (random.below(4)) {
        case 0:
            factors = factors * random.power_of_ten(-9, 9);
            break;
        case 1:
            at(factors, random.below(3)) = random.power_of_ten(0, 7);
            break;
        case 2:
            at(factors, random.below(3)) = random.power_of_ten(-44, -7);
            break;
        default:
            factors = {random.power_of_ten(-3, 3), random.power_of_ten(-3, 3),
                       random.power_of_ten(-3, 3)};
    }
    for (Vec3& p : mesh.vertices) p = {p.x * factors.x, p.y * factors.y, p.z * factors.z};
}

}  // namespace

const char* family_name(Family family) { return families[std::size_t(family)].name; }

void add_triangle(Mesh& mesh, Vec3 a, Vec3 b, Vec3 c) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), {a, b, c});
    mesh.triangles.push_back({first, first + 1, first + 2});
}

Mesh make_sphere(std::uint32_t around, std::uint32_t rings, Vec3 center, Vec3 radii) {
    Mesh mesh;
    mesh.vertices.push_back({center.x, center.y, center.z + radii.z});
    for (std::uint32_t j = 1; j < rings; ++j)
        for (std::uint32_t i = 0; i < around; ++i) {
            const double down = std::numbers::pi * j / rings;
            const double turn = 2 * std::numbers::pi * i / around;
            mesh.vertices.push_back(
                {static_cast<float>(center.x + radii.x * std::sin(down) * std::cos(turn)),
                 static_cast<float>(center.y + radii.y * std::sin(down) * std::sin(turn)),
                 static_cast<float>(center.z + radii.z * std::cos(down))});
        }
    mesh.vertices.push_back({center.x, center.y, center.z - radii.z});
    const auto last = static_cast<std::uint32_t>(mesh.vertices.size() - 1);
    const auto id = [&](std::uint32_t j, std::uint32_t i) {
        return 1 + (j - 1) * around + i % around;
    };
    for (std::uint32_t i = 0; i < around; ++i) {
        mesh.triangles.push_back({0, id(1, i), id(1, i + 1)});
        mesh.triangles.push_back({last, id(rings - 1, i + 1), id(rings - 1, i)});
    }
    for (std::uint32_t j = 1; j + 1 < rings; ++j)
        for (std::uint32_t i = 0; i < around; ++i) {
            mesh.triangles.push_back({id(j, i), id(j + 1, i), id(j + 1, i + 1)});
            mesh.triangles.push_back({id(j, i), id(j + 1, i + 1), id(j, i + 1)});
        }
    return mesh;
}

TestMesh make_mesh(Random& random, Family family, std::uint32_t triangles) {
    return {family, families[std::size_t(family)].make(random, triangles)};
}

TestMesh any_mesh(Random& random, std::uint32_t most) {
    TestMesh made = make_mesh(random, static_cast<Family>(random.below(std::size_t(Family::count))),
                              1 + random.below(most));
    if (random.chance(0.25)) deform(random, made.mesh);
    return made;
}

TestMesh closed_mesh(Random& random, std::uint32_t most, bool whole) {
    constexpr Family closed[] = {Family::voxels, Family::tetrahedra, Family::sphere,
                                 Family::stretched_sphere};
    const Family family = closed[random.below(whole ? 2 : 4)];
    TestMesh made = make_mesh(random, family, 1 + random.below(most));
    if (!whole && random.chance(0.3)) {
        const float scale = random.power_of_ten(-6, 6);
        const Vec3 move = random.cube() * random.power_of_ten(-3, 3);
        for (Vec3& p : made.mesh.vertices) p = (p + move) * scale;
    }
    return made;
}

Aabb finite_bounds(const Mesh& mesh) {
    Aabb box{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
    for (const Vec3& p : mesh.vertices) {
        if (!(std::fabs(p.x) <= 1e12f && std::fabs(p.y) <= 1e12f && std::fabs(p.z) <= 1e12f))
            continue;
        for (std::uint32_t axis = 0; axis < 3; ++axis) {
            at(box.lo, axis) = std::min(at(box.lo, axis), at(p, axis));
            at(box.hi, axis) = std::max(at(box.hi, axis), at(p, axis));
        }
    }
    return box.lo.x <= box.hi.x ? box : Aabb{{0, 0, 0}, {1, 1, 1}};
}

MeshD to_double(Random& random, const Mesh& mesh) {
    MeshD made;
    made.triangles = mesh.triangles;
    const Vec3d move =
        random.chance(0.5) ? wide(random.cube() * random.power_of_ten(0, 10)) : Vec3d{0, 0, 0};
    const double digits = random.chance(0.5) ? 1e-9 * random.unit() : 0;
    for (const Vec3& p : mesh.vertices)
        made.vertices.push_back({p.x * (1 + digits * random.unit()) + move.x,
                                 p.y * (1 + digits * random.unit()) + move.y,
                                 p.z * (1 + digits * random.unit()) + move.z});
    return made;
}

template <class AnyMesh>
static AnyMesh kept_only(const AnyMesh& mesh, const std::vector<std::uint32_t>& keep) {
    AnyMesh made;
    for (const std::uint32_t t : keep) {
        const auto first = static_cast<std::uint32_t>(made.vertices.size());
        for (const std::uint32_t corner : mesh.triangles[t])
            made.vertices.push_back(mesh.vertices[corner]);
        made.triangles.push_back({first, first + 1, first + 2});
    }
    return made;
}
Mesh only(const Mesh& mesh, const std::vector<std::uint32_t>& keep) {
    return kept_only(mesh, keep);
}
MeshD only(const MeshD& mesh, const std::vector<std::uint32_t>& keep) {
    return kept_only(mesh, keep);
}

}  // namespace raydix::attack
