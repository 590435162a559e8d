// Paths are followed by number from the outermost scene inward, without memory of their own; points
// and normals come back the same way.
#include "engine/hit_points.h"

#include <raydix/error.h>
#include <raydix/surface.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <string>

#include "engine/scene_state.h"
#include "exec/search.h"
#include "instances/affine.h"

namespace raydix {
namespace {

/// The instance that path `number` begins with, 1 <= number <= paths. Numbers are evenly apart
/// where all instances hold equally many paths: the place is guessed first.
const InstanceName& instance_on(const SceneTree& scene, std::uint32_t number) {
    const auto& all = scene.instances;
    const std::size_t guess = std::uint64_t{number - 1} * all.size() / scene.paths;
    if (all[guess].number <= number && (guess + 1 == all.size() || number < all[guess + 1].number))
        return all[guess];
    const auto after =
        std::upper_bound(all.begin(), all.end(), number,
                         [](std::uint32_t n, const InstanceName& name) { return n < name.number; });
    return *(after - 1);
}

/// Null if there is none. Ids ascend, so that mesh `id` has at most `id` before it.
const MeshName* mesh_by_id(const SceneTree& scene, std::uint32_t id) {
    const auto& all = scene.mesh_names;
    if (id < all.size() && all[id].id == id) return &all[id];
    const auto end =
        all.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(id, all.size()));
    const auto found = std::lower_bound(
        all.begin(), end, id,
        [](const MeshName& name, std::uint32_t wanted) { return name.id < wanted; });
    return found != end && found->id == id ? &*found : nullptr;
}

/// The triangle of a hit if there is no instance on its way; `scene` is where its path ends.
const MeshName* mesh_of(const SceneTree& scene, const Hit& hit) {
    const MeshName* const name = mesh_by_id(scene, hit.geometry);
    return name != nullptr && hit.prim < name->mesh.triangles.size() ? name : nullptr;
}

/// -0 becomes +0, as in trees.
Double3 corner_of(const Vec3& p) { return Double3(p) + Double3(0, 0, 0); }

/// A plane's normal through a map: the direction of its inverse transpose. Cofactors of floats are
/// exact but for one rounding each.
Double3 turned(const Affine& map, Double3 normal) {
    const Double3 x = cross(map.y, map.z), y = cross(map.z, map.x), z = cross(map.x, map.y);
    const Double3 out{dot(x, normal), dot(y, normal), dot(z, normal)};
    return dot(map.x, x) < 0.0 ? out * -1.0 : out;
}

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

[[noreturn]] void refuse(const SceneTree& scene, const Hit& hit, std::size_t at) {
    const std::string start = "hit " + std::to_string(at) + ": ";
    if (hit.instance > scene.paths)
        throw InputError(start + "the scene has no path " + std::to_string(hit.instance) +
                         " of instances");
    const SceneTree* inner = &scene;
    for (std::uint32_t left = hit.instance; left != 0;) {
        const InstanceName& name = instance_on(*inner, left);
        left -= name.number;
        inner = name.scene.get();
    }
    const MeshName* const name = mesh_by_id(*inner, hit.geometry);
    const std::string mesh = "mesh " + std::to_string(hit.geometry);
    const std::string where =
        hit.instance == 0 ? "" : " on path " + std::to_string(hit.instance) + " of instances";
    if (name == nullptr) throw InputError(start + "the scene has no " + mesh + where);
    throw InputError(start + mesh + where + " has " + std::to_string(name->mesh.triangles.size()) +
                     " triangles; there is no triangle " + std::to_string(hit.prim));
}

/// value(hit i, its triangle) for all hits, in double; NaN for misses.
template <class Value>
void fill(const Scene& scene, std::span<const Hit> hits, std::span<Vec3> out, int threads,
          const char* call, const Value& value) {
    const SceneTree& tree = *SceneAccess::tree(scene);
    if (hits.size() != out.size())
        throw InputError(std::string(call) + ": " + std::to_string(hits.size()) +
                         " hits, but room for " + std::to_string(out.size()));
    std::atomic<bool> all_there{true};
    with_threads(threads, [&] {
        for_each_range(hits.size(), 4096, [&](std::size_t begin, std::size_t end) {
            HitTriangle triangle;
            for (std::size_t i = begin; i < end; ++i) {
                if (!hits[i].hit())
                    out[i] = {nan, nan, nan};
                else if (find_triangle(tree, hits[i], triangle))
                    out[i] = value(hits[i], triangle).rounded();
                else
                    all_there.store(false, std::memory_order_relaxed);
            }
        });
        if (!all_there.load()) check_hits(tree, hits);
    });
}

}  // namespace

bool find_triangle(const SceneTree& scene, const Hit& hit, HitTriangle& triangle) {
    triangle.levels = 0;
    if (hit.instance > scene.paths) return false;
    const SceneTree* inner = &scene;
    for (std::uint32_t left = hit.instance; left != 0;) {
        const InstanceName& name = instance_on(*inner, left);
        triangle.way[triangle.levels++] = &name;
        left -= name.number;
        inner = name.scene.get();
    }
    const MeshName* const name = mesh_of(*inner, hit);
    if (name == nullptr) return false;
    const Triangle& t = name->mesh.triangles[hit.prim];
    for (std::size_t k = 0; k < 3; ++k) triangle.corners[k] = corner_of(name->mesh.vertices[t[k]]);
    return true;
}

Double3 HitTriangle::point(double u, double v) const {
    Double3 p = corners[0] * (1.0 - u - v) + corners[1] * u + corners[2] * v;
    for (std::uint32_t level = levels; level-- > 0;) p = affine_of(way[level]->transform).point(p);
    return p;
}

Double3 HitTriangle::normal() const {
    Double3 n = cross(corners[1] - corners[0], corners[2] - corners[0]);
    for (std::uint32_t level = levels; level-- > 0;)
        n = turned(affine_of(way[level]->transform), normalized(n));
    return n;
}

void check_hits(const SceneTree& scene, std::span<const Hit> hits) {
    const std::size_t bad = first_index_where(hits.size(), [&](std::size_t i) {
        HitTriangle triangle;
        return hits[i].hit() && !find_triangle(scene, hits[i], triangle);
    });
    if (bad < hits.size()) refuse(scene, hits[bad], bad);
}

void positions(const Scene& scene, std::span<const Hit> hits, std::span<Vec3> points, int threads) {
    fill(scene, hits, points, threads, "positions",
         [](const Hit& hit, const HitTriangle& triangle) { return triangle.point(hit.u, hit.v); });
}

std::vector<Vec3> positions(const Scene& scene, std::span<const Hit> hits, int threads) {
    std::vector<Vec3> points(hits.size());
    positions(scene, hits, points, threads);
    return points;
}

void normals(const Scene& scene, std::span<const Hit> hits, std::span<Vec3> normals, int threads) {
    fill(scene, hits, normals, threads, "normals",
         [](const Hit&, const HitTriangle& triangle) { return normalized(triangle.normal()); });
}

std::vector<Vec3> normals(const Scene& scene, std::span<const Hit> hits, int threads) {
    std::vector<Vec3> out(hits.size());
    normals(scene, hits, out, threads);
    return out;
}

}  // namespace raydix
