#include "engine/scene_walk.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "trace/ray_frame.h"

namespace raydix {
namespace {

/// Fewer rays than this go one by one.
constexpr std::uint32_t least_together = 6;

float in_units_of(double scale, float t) { return static_cast<float>(double{t} / scale); }

}  // namespace

/// Rays in the space of one scene. Directions are near unit length, by powers of two.
struct SceneWalk::Level {
    std::vector<Ray> rays;  // as floats have the lines; tmax: as far as they still go
    std::vector<WideRayLine> lines;
    std::vector<double> scale;      // t of the caller's ray = scale * t here
    std::vector<std::uint32_t> id;  // in the job
    std::vector<Hit> hits;
    std::vector<std::uint8_t> occluded;
    std::vector<std::uint32_t> seen;  // those of a list that may see something
    StreamMemory parts_memory, mesh_memory;
    StackMemory parts_stack, mesh_stack;

    [[nodiscard]] std::size_t size() const { return rays.size(); }
    void clear() { rays.clear(), lines.clear(), scale.clear(), id.clear(); }
};

class SceneWalk::Visitor final : public PartVisitor {
public:
    Visitor(SceneWalk& walk, std::size_t depth, const SceneTree& tree, const PartTree& parts,
            std::uint32_t number)
        : walk_(walk), depth_(depth), tree_(tree), parts_(parts), number_(number) {}

    void visit(std::uint32_t place, const std::uint32_t* rays, std::uint32_t count) override {
        walk_.visit(depth_, tree_, number_, parts_.part[place], rays, count);
    }

private:
    SceneWalk& walk_;
    std::size_t depth_;
    const SceneTree& tree_;
    const PartTree& parts_;
    std::uint32_t number_;
};

SceneWalk::SceneWalk() = default;
SceneWalk::~SceneWalk() = default;

SceneWalk::Level& SceneWalk::level(std::size_t depth) {
    while (levels_.size() <= depth) levels_.push_back(std::make_unique<Level>());
    return *levels_[depth];
}

void SceneWalk::begin(const SceneTree& tree, const SceneQuery& query) {
    tree_ = &tree;
    query_ = query;
    rays_.clear();
    best_.clear();
    level(0).clear();
}

void SceneWalk::add(const Ray& ray, std::uint32_t mask) {
    const auto id = static_cast<std::uint32_t>(rays_.size());
    rays_.push_back({ray.tmin, ray.tmax, mask});
    best_.push_back({});
    enter(level(0), id, {Double3(ray.origin), Double3(ray.direction)}, 1.0);
}

bool SceneWalk::enter(Level& level, std::uint32_t id, WideRayLine line, double scale) const {
    const Double3 d = line.direction;
    const double by = direction_scale(std::max({std::fabs(d.x), std::fabs(d.y), std::fabs(d.z)}));
    line.direction = d * by;
    scale *= by;
    const Ray ray =
        line.rounded(in_units_of(scale, rays_[id].tmin), in_units_of(scale, rays_[id].tmax));
    if (!is_valid_ray(ray)) return false;
    level.rays.push_back(ray);
    level.lines.push_back(line);
    level.scale.push_back(scale);
    level.id.push_back(id);
    shorten(level, static_cast<std::uint32_t>(level.size() - 1));
    return true;
}

void SceneWalk::shorten(Level& level, std::uint32_t ray) const {
    const std::uint32_t id = level.id[ray];
    const SceneHit& best = best_[id];
    float t = rays_[id].tmax;
    if (best.hit()) {
        // What differs here may be equal in the caller's units where those are subnormal: it must
        // be found too.
        t = best.t < std::numeric_limits<float>::min() ? std::nextafter(best.t, infinity) : best.t;
        if (query_.any) {
            level.rays[ray].tmax = -1.0f;
            return;
        }
    }
    level.rays[ray].tmax = in_units_of(level.scale[ray], t);
}

void SceneWalk::trace() { walk(0, *tree_, 0); }

void SceneWalk::walk(std::size_t depth, const SceneTree& tree, std::uint32_t number) {
    Level& here = level(depth);
    if (here.size() == 0) return;
    if (const MeshTree* const mesh = tree.only_mesh()) {
        visit_mesh(here, *mesh, number, nullptr, static_cast<std::uint32_t>(here.size()));
        return;
    }
    TriangleBlock room;  // never used: no leaf holds triangles
    for (const PartTree* const parts : {&tree.near, &tree.wild}) {
        if (parts->empty()) continue;
        here.parts_stack.reserve(parts->arrays.stats.max_depth);
        Visitor visitor(*this, depth, tree, *parts, number);
        query_.kernels->parts({view_of(parts->arrays, room), here.rays.data(), here.size(),
                               query_.any, here.parts_stack.view(), &here.parts_memory,
                               parts->growth, &visitor});
    }
}

void SceneWalk::visit(std::size_t depth, const SceneTree& tree, std::uint32_t number,
                      std::uint32_t part, const std::uint32_t* rays, std::uint32_t count) {
    const std::size_t meshes = tree.meshes.size();
    if (part < meshes)
        visit_mesh(level(depth), *tree.meshes[part], number, rays, count);
    else
        visit_instance(depth, tree.instances[part - meshes], number, rays, count);
}

void SceneWalk::visit_instance(std::size_t depth, const PlacedScene& placed, std::uint32_t number,
                               const std::uint32_t* rays, std::uint32_t count) {
    Level &outside = level(depth), &inside = level(depth + 1);
    inside.clear();
    for (std::uint32_t k = 0; k < count; ++k) {
        const std::uint32_t ray = rays[k], id = outside.id[ray];
        if ((placed.mask & rays_[id].mask) == 0) continue;
        enter(inside, id, outside.lines[ray].into(placed.inverse), outside.scale[ray]);
    }
    walk(depth + 1, *placed.scene, number + placed.number);
    for (std::uint32_t k = 0; k < count; ++k) shorten(outside, rays[k]);
}

void SceneWalk::visit_mesh(Level& level, const MeshTree& mesh, std::uint32_t number,
                           const std::uint32_t* rays, std::uint32_t count) {
    if (mesh.tree->empty()) return;
    if (mesh.mask != ~std::uint32_t{0}) {
        level.seen.clear();
        for (std::uint32_t k = 0; k < count; ++k) {
            const std::uint32_t ray = rays == nullptr ? k : rays[k];
            if ((mesh.mask & rays_[level.id[ray]].mask) != 0) level.seen.push_back(ray);
        }
        rays = level.seen.data();
        count = static_cast<std::uint32_t>(level.seen.size());
        if (count == 0) return;
    }
    level.mesh_stack.reserve(mesh.tree->stats().max_depth);
    if (query_.any)
        level.occluded.resize(level.size());
    else
        level.hits.resize(level.size());
    TriangleBlock room{};
    const SimdJob job{view_of(mesh.tree->arrays(), room),
                      level.rays.data(),
                      rays,
                      count,
                      query_.any ? HitRows{} : HitRows{level.hits.data()},
                      query_.any ? level.occluded.data() : nullptr,
                      level.mesh_stack.view(),
                      level.mesh_stack.packet_view(),
                      &level.mesh_memory,
                      false};
    SimdCounts counts;
    const SimdKernels& kernels = *query_.kernels;
    (count < least_together ? kernels.single
     : query_.packets       ? kernels.packets
                            : kernels.streams)(job, counts);
    for (std::uint32_t k = 0; k < count; ++k)
        take(level, mesh, number, rays == nullptr ? k : rays[k]);
}

void SceneWalk::take(Level& level, const MeshTree& mesh, std::uint32_t number, std::uint32_t ray) {
    SceneHit& best = best_[level.id[ray]];
    if (query_.any) {
        if (level.occluded[ray] == 0) return;
        best.prim = 0;
        shorten(level, ray);
        return;
    }
    const Hit& hit = level.hits[ray];
    if (!hit.hit()) return;
    SceneHit found{hit, no_primitive, number};
    found.t = static_cast<float>(double{hit.t} * level.scale[ray]) + 0.0f;
    if (best.hit() && found.t > best.t) return;
    mesh.name(found);
    const auto key = [](const SceneHit& h) {
        return std::tuple(h.t, h.instance, h.geometry, h.prim);
    };
    if (best.hit() && !(key(found) < key(best))) return;
    best = found;
    shorten(level, ray);
}

}  // namespace raydix
