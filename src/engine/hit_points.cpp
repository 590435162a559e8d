// Paths are followed by number from the outermost scene inward, without memory of their own; points
// and normals come back the same way.
#include "engine/hit_points.h"

#include <raydix/error.h>
#include <raydix/surface.h>

#include <algorithm>
#include <limits>
#include <string>

#include "engine/affine.h"
#include "engine/scene_state.h"
#include "engine/shape_tree.h"
#include "exec/search.h"

namespace raydix {
namespace {

/// The instance that path `number` begins with, 1 <= number <= paths. Numbers are evenly apart
/// where all instances hold equally many paths: the place is guessed first.
template <class Tree>
const auto& instance_on(const Tree& scene, std::uint32_t number) {
    const auto& all = scene.instances;
    const std::size_t guess = std::uint64_t{number - 1} * all.size() / scene.paths;
    if (all[guess].number <= number && (guess + 1 == all.size() || number < all[guess + 1].number))
        return all[guess];
    const auto after =
        std::upper_bound(all.begin(), all.end(), number,
                         [](std::uint32_t n, const auto& name) { return n < name.number; });
    return *(after - 1);
}

/// Null if there is none. Ids ascend, so that mesh `id` has at most `id` before it.
template <class Tree>
auto mesh_by_id(const Tree& scene, std::uint32_t id) -> decltype(scene.mesh_names.data()) {
    const auto& all = scene.mesh_names;
    if (id < all.size() && all[id].id == id) return &all[id];
    const auto end =
        all.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(id, all.size()));
    const auto found =
        std::lower_bound(all.begin(), end, id,
                         [](const auto& name, std::uint32_t wanted) { return name.id < wanted; });
    return found != end && found->id == id ? &*found : nullptr;
}

/// -0 becomes +0, as in trees.
template <class Point>
Double3 corner_of(const Point& p) {
    return Double3(p) + Double3(0, 0, 0);
}

/// A plane's normal through an instance: the direction of its map's inverse transpose. Cofactors of
/// floats are exact but for one rounding each.
Double3 turned(const InstanceName& instance, Double3 normal) {
    const Affine map = affine_of(instance.transform);
    const Double3 x = cross(map.y, map.z), y = cross(map.z, map.x), z = cross(map.x, map.y);
    const Double3 out{dot(x, normal), dot(y, normal), dot(z, normal)};
    return dot(map.x, x) < 0.0 ? out * -1.0 : out;
}
/// Cofactors of doubles may cancel; the inverse that rays go through is right to the last digits.
Double3 turned(const InstanceNameD& instance, Double3 normal) {
    const AffineD& inverse = instance.inverse.rows;
    return (inverse.x * normal.x + inverse.y * normal.y) + inverse.z * normal.z;
}

/// NaN if there is no direction. Squares of lengths stay within the range of doubles.
Double3 unit_of(Double3 v) {
    const double square = dot(v, v);
    if (square < 0x1p-900) return normalized(v * 0x1p600);
    if (square > 0x1p900) return normalized(v * 0x1p-600);
    return normalized(v);
}

/// The scene at the end of a hit's path; null if there is no such path.
template <class Tree, class AnyHit>
const Tree* follow_path(const Tree& scene, const AnyHit& hit, BasicHitTriangle<Tree>& triangle) {
    triangle.levels = 0;
    if (hit.instance > scene.paths) return nullptr;
    const Tree* inner = &scene;
    for (std::uint32_t left = hit.instance; left != 0;) {
        const auto& instance = instance_on(*inner, left);
        triangle.way[triangle.levels++] = &instance;
        left -= instance.number;
        inner = instance.scene.get();
    }
    return inner;
}

/// The mesh of a hit, and the way to it; null if there is no such triangle.
template <class Tree, class AnyHit>
auto mesh_of(const Tree& scene, const AnyHit& hit, BasicHitTriangle<Tree>& triangle)
    -> decltype(scene.mesh_names.data()) {
    const Tree* const inner = follow_path(scene, hit, triangle);
    const auto* const name = inner == nullptr ? nullptr : mesh_by_id(*inner, hit.geometry);
    return name != nullptr && hit.prim < name->mesh.triangles.size() ? name : nullptr;
}

template <class Tree, class AnyHit>
bool find(const Tree& scene, const AnyHit& hit, BasicHitTriangle<Tree>& triangle) {
    const auto* const name = mesh_of(scene, hit, triangle);
    if (name == nullptr) return false;
    const Triangle& t = name->mesh.triangles[hit.prim];
    for (std::size_t k = 0; k < 3; ++k) triangle.corners[k] = corner_of(name->mesh.vertices[t[k]]);
    return true;
}

/// A hit of shapes, and the way to it.
template <class Tree>
struct HitShape {
    using Shapes = typename decltype(Tree::shapes)::value_type::element_type;

    BasicHitTriangle<Tree> way;  // without corners
    const Shapes* shapes = nullptr;
    std::uint32_t prim = 0;
};

template <class Tree, class AnyHit>
bool find(const Tree& scene, const AnyHit& hit, HitShape<Tree>& shape) {
    const Tree* const inner = follow_path(scene, hit, shape.way);
    if (inner == nullptr) return false;
    const auto at = std::ranges::lower_bound(inner->shapes, hit.geometry, {},
                                             [](const auto& shapes) { return shapes->id; });
    if (at == inner->shapes.end() || (*at)->id != hit.geometry) return false;
    shape.shapes = at->get();
    shape.prim = hit.prim;
    return hit.prim < count_of(shape.shapes->shapes);
}

template <class Tree, class AnyHit>
[[noreturn]] void refuse(const Tree& scene, const AnyHit& hit, std::size_t at) {
    const std::string start = "hit " + std::to_string(at) + ": ";
    if (hit.instance > scene.paths)
        throw InputError(start + "the scene has no path " + std::to_string(hit.instance) +
                         " of instances");
    const Tree* inner = &scene;
    for (std::uint32_t left = hit.instance; left != 0;) {
        const auto& instance = instance_on(*inner, left);
        left -= instance.number;
        inner = instance.scene.get();
    }
    for (const auto& shapes : inner->shapes) {
        if (shapes->id != hit.geometry) continue;
        const std::string geometry = name_of(*shapes, hit.instance);
        const std::uint64_t count = count_of(shapes->shapes);
        if (hit.prim < count)
            throw InputError(start + geometry + " has no triangles: give the rays too");
        throw InputError(start + geometry + " has " + std::to_string(count) +
                         " primitives; there is no primitive " + std::to_string(hit.prim));
    }
    const auto* const name = mesh_by_id(*inner, hit.geometry);
    const std::string where = on_path(hit.instance);
    const std::string mesh = "mesh " + std::to_string(hit.geometry);
    if (name == nullptr) throw InputError(start + "the scene has no " + mesh + where);
    throw InputError(start + mesh + where + " has " + std::to_string(name->mesh.triangles.size()) +
                     " triangles; there is no triangle " + std::to_string(hit.prim));
}

/// Throws InputError that names the first hit without a triangle, if there is one.
template <class Tree, class AnyHit>
void check(const Tree& scene, std::span<const AnyHit> hits) {
    const std::size_t bad = first_index_where(hits.size(), [&](std::size_t i) {
        BasicHitTriangle<Tree> triangle;
        return hits[i].hit() && mesh_of(scene, hits[i], triangle) == nullptr;
    });
    if (bad < hits.size()) refuse(scene, hits[bad], bad);
}

/// What is asked of hits whose rays are known.
struct CallByRays {
    const char* name;
    bool takes_user_geometry;
};

/// The same where hits of shapes serve too.
template <class Tree, class AnyHit>
void check_with_shapes(const Tree& scene, std::span<const AnyHit> hits, const CallByRays& call) {
    const auto is_refused = [&](const HitShape<Tree>& shape) {
        return !call.takes_user_geometry && shape.shapes->user() != nullptr;
    };
    const std::size_t bad = first_index_where(hits.size(), [&](std::size_t i) {
        BasicHitTriangle<Tree> triangle;
        HitShape<Tree> shape;
        return hits[i].hit() && mesh_of(scene, hits[i], triangle) == nullptr &&
               (!find(scene, hits[i], shape) || is_refused(shape));
    });
    if (bad == hits.size()) return;
    HitShape<Tree> shape;
    if (find(scene, hits[bad], shape))
        throw InputError(std::string(call.name) + ": hit " + std::to_string(bad) + ": " +
                         name_of(*shape.shapes, hits[bad].instance) +
                         " has no normals: only its owner knows them");
    refuse(scene, hits[bad], bad);
}

/// value(hit i, its triangle) for all hits, in double; NaN for misses.
template <class Scalar, class AnyHit, class Point, class Value>
void fill(const BasicScene<Scalar>& scene, std::span<const AnyHit> hits, std::span<Point> out,
          int threads, const char* call, const Value& value) {
    using Tree = typename SceneKind<Scalar>::Tree;
    constexpr Scalar nan = std::numeric_limits<Scalar>::quiet_NaN();
    const Tree& tree = *BasicSceneInternals<Scalar>::tree(scene);
    if (hits.size() != out.size())
        throw InputError(std::string(call) + ": " + std::to_string(hits.size()) +
                         " hits, but room for " + std::to_string(out.size()));
    with_threads(threads, [&] {
        check(tree, hits);
        for_each_range(hits.size(), 4096, [&](std::size_t begin, std::size_t end) {
            BasicHitTriangle<Tree> triangle;
            for (std::size_t i = begin; i < end; ++i) {
                if (hits[i].hit() && find(tree, hits[i], triangle))
                    value(hits[i], triangle).round_to(out[i]);
                else
                    out[i] = {nan, nan, nan};
            }
        });
    });
}

/// Of hits whose rays are known: as above; value_of_shape(ray i, hit i, its shape) for shapes.
template <class Scalar, class AnyRay, class AnyHit, class Point, class Value, class ValueOfShape>
void fill_by_rays(const BasicScene<Scalar>& scene, std::span<const AnyRay> rays,
                  std::span<const AnyHit> hits, std::span<Point> out, int threads,
                  const CallByRays& call, const Value& value, const ValueOfShape& value_of_shape) {
    using Tree = typename SceneKind<Scalar>::Tree;
    constexpr Scalar nan = std::numeric_limits<Scalar>::quiet_NaN();
    const Tree& tree = *BasicSceneInternals<Scalar>::tree(scene);
    if (hits.size() != out.size() || hits.size() != rays.size())
        throw InputError(std::string(call.name) + ": " + std::to_string(rays.size()) + " rays, " +
                         std::to_string(hits.size()) + " hits and room for " +
                         std::to_string(out.size()));
    with_threads(threads, [&] {
        check_with_shapes(tree, hits, call);
        for_each_range(hits.size(), 4096, [&](std::size_t begin, std::size_t end) {
            BasicHitTriangle<Tree> triangle;
            HitShape<Tree> shape;
            for (std::size_t i = begin; i < end; ++i) {
                if (!hits[i].hit())
                    out[i] = {nan, nan, nan};
                else if (find(tree, hits[i], triangle))
                    value(hits[i], triangle).round_to(out[i]);
                else if (find(tree, hits[i], shape))
                    value_of_shape(i, shape).round_to(out[i]);
            }
        });
    });
}

template <class AnyRay>
Double3 point_on(const AnyRay& ray, double t) {
    return Double3(ray.origin) + Double3(ray.direction) * t;
}

/// From the axis or center of a shape to a point, in the shape's own space. Not of user geometry.
template <class Tree>
Double3 away_from(const HitShape<Tree>& hit, Double3 point) {
    constexpr std::size_t of_spheres = 0, of_capsules = 1, of_balls = 2;
    const auto& shapes = hit.shapes->shapes;
    if (const auto* const spheres = std::get_if<of_spheres>(&shapes))
        return point - Double3((*spheres)[hit.prim].center);
    if (const auto* const balls = std::get_if<of_balls>(&shapes))
        return point - Double3(balls->centers[hit.prim]);
    const auto& capsule = std::get<of_capsules>(shapes)[hit.prim];
    const Double3 a(capsule.a), axis = Double3(capsule.b) - a, from = point - a;
    const double length2 = dot(axis, axis);
    const double along = length2 > 0 ? std::clamp(dot(from, axis) / length2, 0.0, 1.0) : 0.0;
    return from - axis * along;
}

Double3 into(const InstanceName& instance, Double3 point) {
    return inverse_of(affine_of(instance.transform))->point(point);
}
Double3 into(const InstanceNameD& instance, Double3 point) { return instance.inverse.point(point); }

template <class Tree>
Double3 normal_of(const HitShape<Tree>& hit, Double3 point) {
    const BasicHitTriangle<Tree>& way = hit.way;
    for (std::uint32_t level = 0; level < way.levels; ++level) point = into(*way.way[level], point);
    Double3 normal = away_from(hit, point);
    for (std::uint32_t level = way.levels; level-- > 0;)
        normal = turned(*way.way[level], unit_of(normal));
    return unit_of(normal);
}

template <class Tree, class AnyRay, class AnyHit>
Double3 normal_of_hit(const Tree& scene, const AnyRay& ray, const AnyHit& hit) {
    BasicHitTriangle<Tree> triangle;
    if (find(scene, hit, triangle)) return triangle.normal();
    HitShape<Tree> shape;
    if (!find(scene, hit, shape) || shape.shapes->user() != nullptr) return {0, 0, 0};
    return normal_of(shape, point_on(ray, hit.t));
}

template <class Scalar, class AnyHit, class Point>
void fill_positions(const BasicScene<Scalar>& scene, std::span<const AnyHit> hits,
                    std::span<Point> points, int threads) {
    fill(scene, hits, points, threads, "positions",
         [](const auto& hit, const auto& triangle) { return triangle.point(hit.u, hit.v); });
}

template <class Scalar, class AnyHit, class Point>
void fill_normals(const BasicScene<Scalar>& scene, std::span<const AnyHit> hits,
                  std::span<Point> normals, int threads) {
    fill(scene, hits, normals, threads, "normals",
         [](const auto&, const auto& triangle) { return unit_of(triangle.normal()); });
}

template <class Scalar, class AnyRay, class AnyHit, class Point>
void fill_positions_by_rays(const BasicScene<Scalar>& scene, std::span<const AnyRay> rays,
                            std::span<const AnyHit> hits, std::span<Point> points, int threads) {
    fill_by_rays(
        scene, rays, hits, points, threads, {"positions", true},
        [](const auto& hit, const auto& triangle) { return triangle.point(hit.u, hit.v); },
        [&](std::size_t i, const auto&) { return point_on(rays[i], hits[i].t); });
}

template <class Scalar, class AnyRay, class AnyHit, class Point>
void fill_normals_by_rays(const BasicScene<Scalar>& scene, std::span<const AnyRay> rays,
                          std::span<const AnyHit> hits, std::span<Point> normals, int threads) {
    fill_by_rays(
        scene, rays, hits, normals, threads, {"normals", false},
        [](const auto&, const auto& triangle) { return unit_of(triangle.normal()); },
        [&](std::size_t i, const auto& shape) {
            return normal_of(shape, point_on(rays[i], hits[i].t));
        });
}

}  // namespace

std::uint32_t follow_path(const SceneTree& scene, std::uint32_t number,
                          const InstanceName* (&way)[Scene::max_levels]) {
    Hit hit;
    hit.instance = number;
    HitTriangle triangle;
    if (follow_path(scene, hit, triangle) == nullptr) return 0;
    std::copy_n(triangle.way, triangle.levels, way);
    return triangle.levels;
}

Double3 normal_at(const SceneTree& scene, const Ray& ray, const Hit& hit) {
    return normal_of_hit(scene, ray, hit);
}
Double3 normal_at(const SceneTreeD& scene, const RayD& ray, const HitD& hit) {
    return normal_of_hit(scene, ray, hit);
}

void require_normals(const SceneTree& scene, std::span<const Hit> hits, const char* call) {
    check_with_shapes(scene, hits, {call, false});
}
void require_normals(const SceneTreeD& scene, std::span<const HitD> hits, const char* call) {
    check_with_shapes(scene, hits, {call, false});
}

template <class Tree>
Double3 BasicHitTriangle<Tree>::point(double u, double v) const {
    Double3 p = corners[0] * (1.0 - u - v) + corners[1] * u + corners[2] * v;
    for (std::uint32_t level = levels; level-- > 0;) {
        const auto map = affine_of(way[level]->transform);
        p = map.vector(p) + map.move;
    }
    return p;
}

template <class Tree>
Double3 BasicHitTriangle<Tree>::normal() const {
    Double3 n = cross(corners[1] - corners[0], corners[2] - corners[0]);
    for (std::uint32_t level = levels; level-- > 0;) n = turned(*way[level], unit_of(n));
    return n;
}

template struct BasicHitTriangle<SceneTree>;
template struct BasicHitTriangle<SceneTreeD>;

bool find_triangle(const SceneTree& scene, const Hit& hit, HitTriangle& triangle) {
    return find(scene, hit, triangle);
}

void positions(const Scene& scene, std::span<const Hit> hits, std::span<Vec3> points, int threads) {
    fill_positions(scene, hits, points, threads);
}

void positions(const SceneD& scene, std::span<const HitD> hits, std::span<Vec3d> points,
               int threads) {
    fill_positions(scene, hits, points, threads);
}

std::vector<Vec3> positions(const Scene& scene, std::span<const Hit> hits, int threads) {
    std::vector<Vec3> points(hits.size());
    positions(scene, hits, points, threads);
    return points;
}

std::vector<Vec3d> positions(const SceneD& scene, std::span<const HitD> hits, int threads) {
    std::vector<Vec3d> points(hits.size());
    positions(scene, hits, points, threads);
    return points;
}

void normals(const Scene& scene, std::span<const Hit> hits, std::span<Vec3> normals, int threads) {
    fill_normals(scene, hits, normals, threads);
}

void normals(const SceneD& scene, std::span<const HitD> hits, std::span<Vec3d> normals,
             int threads) {
    fill_normals(scene, hits, normals, threads);
}

void positions(const Scene& scene, std::span<const Ray> rays, std::span<const Hit> hits,
               std::span<Vec3> points, int threads) {
    fill_positions_by_rays(scene, rays, hits, points, threads);
}

void positions(const SceneD& scene, std::span<const RayD> rays, std::span<const HitD> hits,
               std::span<Vec3d> points, int threads) {
    fill_positions_by_rays(scene, rays, hits, points, threads);
}

void normals(const Scene& scene, std::span<const Ray> rays, std::span<const Hit> hits,
             std::span<Vec3> normals, int threads) {
    fill_normals_by_rays(scene, rays, hits, normals, threads);
}

void normals(const SceneD& scene, std::span<const RayD> rays, std::span<const HitD> hits,
             std::span<Vec3d> normals, int threads) {
    fill_normals_by_rays(scene, rays, hits, normals, threads);
}

std::vector<Vec3> positions(const Scene& scene, std::span<const Ray> rays,
                            std::span<const Hit> hits, int threads) {
    std::vector<Vec3> points(hits.size());
    positions(scene, rays, hits, points, threads);
    return points;
}

std::vector<Vec3d> positions(const SceneD& scene, std::span<const RayD> rays,
                             std::span<const HitD> hits, int threads) {
    std::vector<Vec3d> points(hits.size());
    positions(scene, rays, hits, points, threads);
    return points;
}

std::vector<Vec3> normals(const Scene& scene, std::span<const Ray> rays, std::span<const Hit> hits,
                          int threads) {
    std::vector<Vec3> out(hits.size());
    normals(scene, rays, hits, out, threads);
    return out;
}

std::vector<Vec3d> normals(const SceneD& scene, std::span<const RayD> rays,
                           std::span<const HitD> hits, int threads) {
    std::vector<Vec3d> out(hits.size());
    normals(scene, rays, hits, out, threads);
    return out;
}

std::vector<Vec3> normals(const Scene& scene, std::span<const Hit> hits, int threads) {
    std::vector<Vec3> out(hits.size());
    normals(scene, hits, out, threads);
    return out;
}

std::vector<Vec3d> normals(const SceneD& scene, std::span<const HitD> hits, int threads) {
    std::vector<Vec3d> out(hits.size());
    normals(scene, hits, out, threads);
    return out;
}

}  // namespace raydix
