// Rays of a job through a scene: down its tree over parts, at each part with all rays that reach
// it, through the inverses of instances into their scenes, and on from there. Included once per
// instruction set by scene_kernels.cpp.
#if defined(RAYDIX_ENGINE_SCENE_WALK_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_SCENE_WALK_H
#undef RAYDIX_ENGINE_SCENE_WALK_H
#else
#define RAYDIX_ENGINE_SCENE_WALK_H
#endif

#include <hwy/highway.h>

#include <limits>
#include <tuple>

#include "engine/scene_job.h"
#include "trace/simd/packets.h"
#include "trace/simd/single.h"
#include "trace/simd/stream.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Boxes of parts widen once more.
HWY_INLINE void grow_pads(const WideView& tree, PadGrowth growth, SingleFrame& frame) {
    const V4 origin = hn::Load(f4, frame.origin);
    alignas(16) float far[4];
    hn::Store(hn::Max(hn::Abs(hn::Sub(hn::Load(f4, tree.lo), origin)),
                      hn::Abs(hn::Sub(hn::Load(f4, tree.hi), origin))),
              f4, far);
    const float grown = growth.rate * max_of(max_of(far[0], far[1]), far[2]) + growth.least;
    const V4 pad = hn::Load(f4, frame.near_pad);
    const V4 whole = hn::CopySign(hn::Add(hn::Abs(pad), hn::Set(f4, grown)), pad);
    hn::Store(whole, f4, frame.near_pad);
    set_starts(tree, origin, hn::Load(f4, frame.inverse), whole, frame);
}

template <bool any>
class SceneWalk {
public:
    explicit SceneWalk(SceneJob& job) : job_(job) {}

    void run() {
        SceneLevel& first = job_.level(0);
        first.begin(job_.n, false);
        job_.hits.assign(job_.n, {});
        job_.limits.resize(job_.n);
        job_.invalid = 0;
        const auto place = [&](std::size_t k) { return job_.order == nullptr ? k : job_.order[k]; };
        constexpr std::size_t ahead = 16;
        for (std::size_t k = 0; k < job_.n; ++k) {
            if (job_.order != nullptr)
                hwy::Prefetch(job_.rays + place(std::min(k + ahead, job_.n - 1)));
            const std::size_t i = place(k);
            const Ray& ray = job_.rays[i];
            job_.limits[k] = {ray.tmin, ray.tmax,
                              job_.masks == nullptr ? job_.mask : job_.masks[i]};
            if (is_valid(ray))
                add_first(first, ray, static_cast<std::uint32_t>(k));
            else
                ++job_.invalid;
        }
        walk(0, *job_.tree, 0);
    }

private:
    static constexpr Wanted wanted = any ? Wanted::any : Wanted::closest;
    /// Fewer rays than this go one by one.
    static constexpr std::uint32_t least_together = 6;

    /// A scene, where its rays are, and what leads to it.
    struct Place {
        const SceneTree& scene;
        std::size_t depth;
        std::uint32_t number;  // of the path of instances; 0: none
    };

    /// What takes rays on at the leaves of a tree over parts (single.h).
    class Parts {
    public:
        Parts(SceneWalk& walk, const Place& place, const PartTree& tree)
            : walk_(walk), level_(walk.job_.level(place.depth)), place_(place), tree_(tree) {}

        float visit_one(std::uint32_t leaf, std::uint32_t ray) {
            walk_.visit_one(place_, tree_.part[leaf], ray);
            return reach(ray);
        }
        void visit(std::uint32_t leaf, const std::uint32_t* rays, std::uint32_t count) {
            walk_.visit(place_, tree_.part[leaf], rays, count);
        }
        float reach(std::uint32_t ray) { return walk_.shorten(level_, ray); }

    private:
        SceneWalk& walk_;
        SceneLevel& level_;
        const Place& place_;
        const PartTree& tree_;
    };

    [[nodiscard]] static float in_units_of(double scale, float t) {
        return scale == 1.0 ? t : static_cast<float>(double{t} / scale);
    }

    /// Ends a ray where its best hit is; how far it goes.
    HWY_INLINE float shorten(SceneLevel& level, std::size_t ray) {
        const SceneRaySource& source = level.sources[ray];
        const float reach = in_units_of(source.scale, job_.limits[source.id].reach);
        level.rays[ray].tmax = reach;
        return min_of(reach, std::numeric_limits<float>::max());
    }

    [[nodiscard]] static bool near_unit_length(double longest) {
        return longest > 0x1p-3 && longest < 0x1p3;
    }

    /// A ray as the caller has it becomes the last one of a level.
    HWY_INLINE void add_first(SceneLevel& level, const Ray& ray, std::uint32_t id) {
        level.rays[level.count] = ray;
        level.sources[level.count++] = {1.0, id};
        const Vec3 d = ray.direction;
        const float longest = max_of(max_of(std::fabs(d.x), std::fabs(d.y)), std::fabs(d.z));
        if (!near_unit_length(longest)) rescale(level, longest);
    }
    HWY_NOINLINE void rescale(SceneLevel& level, float longest) {
        Ray& ray = level.rays[level.count - 1];
        SceneRaySource& source = level.sources[level.count - 1];
        source.scale = direction_scale(double{longest});
        const Double3 scaled = Double3(ray.direction) * source.scale;
        ray.direction = scaled.rounded();
        ray.tmin = in_units_of(source.scale, ray.tmin);
        ray.tmax = in_units_of(source.scale, ray.tmax);
    }

    /// Ray `ray` of one level, in double.
    [[nodiscard]] HWY_INLINE SceneLine line_of(const Place& place, const SceneLevel& level,
                                               std::uint32_t ray) const {
        if (place.depth != 0) return level.lines[ray];
        const Ray& exact = level.rays[ray];
        return {{exact.origin.x, exact.origin.y, exact.origin.z},
                {exact.direction.x, exact.direction.y, exact.direction.z}};
    }

    /// A ray goes through the inverse of an instance, in double: ((x + y) + z) + move, nothing
    /// fused. It becomes the last one of the level inside, unless it can hit nothing there.
    HWY_INLINE void enter(const SceneLine& from, const SceneRaySource& source,
                          const PlacedScene& placed, SceneLevel& to) {
        using D = hn::CappedTag<double, 4>;
        const D d;
        alignas(32) double origin[4], direction[4];
        for (std::size_t l = 0; l < 4; l += hn::MaxLanes(d)) {
            const auto x = hn::Load(d, placed.columns[0] + l),
                       y = hn::Load(d, placed.columns[1] + l),
                       z = hn::Load(d, placed.columns[2] + l);
            const auto turned = [&](const double* v) {
                return hn::Add(hn::Add(hn::Mul(x, hn::Set(d, v[0])), hn::Mul(y, hn::Set(d, v[1]))),
                               hn::Mul(z, hn::Set(d, v[2])));
            };
            hn::Store(hn::Add(turned(from.origin), hn::Load(d, placed.columns[3] + l)), d,
                      origin + l);
            hn::Store(turned(from.direction), d, direction + l);
        }
        const double longest = max_of(max_of(std::fabs(direction[0]), std::fabs(direction[1])),
                                      std::fabs(direction[2]));
        double scale = source.scale;
        if (!near_unit_length(longest)) {
            const double by = direction_scale(longest);
            for (int a = 0; a < 3; ++a) direction[a] *= by;
            scale *= by;
        }
        const SceneJob::Limits& limits = job_.limits[source.id];
        Ray& ray = to.rays[to.count];
        ray.origin = {static_cast<float>(origin[0]), static_cast<float>(origin[1]),
                      static_cast<float>(origin[2])};
        ray.direction = {static_cast<float>(direction[0]), static_cast<float>(direction[1]),
                         static_cast<float>(direction[2])};
        ray.tmin = in_units_of(scale, limits.tmin);
        ray.tmax = in_units_of(scale, limits.reach);
        if (!is_valid(ray)) return;
        if (!placed.scene->instances.empty()) {
            SceneLine& line = to.lines[to.count];
            for (int a = 0; a < 3; ++a)
                line.origin[a] = origin[a], line.direction[a] = direction[a];
        }
        to.sources[to.count++] = {scale, source.id};
    }

    /// All rays of the level of `place`.
    void walk(std::size_t depth, const SceneTree& scene, std::uint32_t number) {
        const Place place{scene, depth, number};
        SceneLevel& level = job_.level(depth);
        const auto count = static_cast<std::uint32_t>(level.count);
        if (count < least_together || job_.single) {
            for (std::uint32_t ray = 0; ray < count; ++ray) walk_one(place, ray);
        } else if (const MeshTree* const mesh = scene.only_mesh()) {
            visit_mesh(place, *mesh, nullptr, count);
        } else {
            for (const PartTree* const tree : {&scene.near, &scene.wild})
                if (!tree->empty()) walk_parts(place, *tree);
        }
    }

    void walk_one(const Place& place, std::uint32_t ray) {
        if (const MeshTree* const mesh = place.scene.only_mesh()) {
            visit_mesh_with_one(place, *mesh, ray);
            return;
        }
        SceneLevel& level = job_.level(place.depth);
        TriangleBlock room;  // no leaf holds triangles
        SimdCounts counts;
        for (const PartTree* const tree : {&place.scene.near, &place.scene.wild}) {
            if (tree->empty()) continue;
            const WideView view = view_of(tree->arrays, room);
            SingleFrame frame;
            if (!fill_frame(view, level.rays[ray], frame)) return;
            grow_pads(view, tree->growth, frame);
            level.parts_stack.reserve(tree->arrays.stats.max_depth);
            Parts parts(*this, place, *tree);
            SingleRay<wanted, false, false, false, Parts>(view, frame, level.parts_stack.view(),
                                                          counts, &parts, ray)
                .trace(0, {frame.tmax});
        }
    }

    HWY_NOINLINE void walk_parts(const Place& place, const PartTree& tree) {
        SceneLevel& level = job_.level(place.depth);
        level.parts_stack.reserve(tree.arrays.stats.max_depth);
        TriangleBlock room;  // no leaf holds triangles
        const SimdJob rays{view_of(tree.arrays, room),
                           level.rays.data(),
                           nullptr,
                           level.count,
                           {},
                           nullptr,
                           level.parts_stack.view(),
                           {},
                           &level.parts_memory,
                           false};
        Parts parts(*this, place, tree);
        SimdCounts counts;
        RaySorter sorter;
        sorter.sort(rays);
        for (std::uint32_t code = 0; code < odd_ray_class; ++code) {
            const std::uint32_t count = sorter.count(code);
            if (count == 0) continue;
            const std::int32_t* const index = sorter.rays(code);
            const StreamFrame frame = fill_stream(rays, index, count, code, tree.growth);
            StreamWalk<any, false, false, Parts>(rays.tree, frame, *rays.memory, rays.stack, counts,
                                                 &parts, index)
                .trace();
        }
    }

    void visit_one(const Place& place, std::uint32_t part, std::uint32_t ray) {
        const std::size_t meshes = place.scene.meshes.size();
        if (part < meshes) {
            visit_mesh_with_one(place, *place.scene.meshes[part], ray);
            return;
        }
        const PlacedScene& placed = place.scene.instances[part - meshes];
        const SceneLevel& outside = job_.level(place.depth);
        const SceneRaySource& source = outside.sources[ray];
        if ((placed.mask & job_.limits[source.id].mask) == 0) return;
        SceneLevel& inside = job_.level(place.depth + 1);
        inside.begin(1, !placed.scene->instances.empty());
        enter(line_of(place, outside, ray), source, placed, inside);
        if (inside.count != 0)
            walk_one({*placed.scene, place.depth + 1, place.number + placed.number}, 0);
    }

    void visit(const Place& place, std::uint32_t part, const std::uint32_t* rays,
               std::uint32_t count) {
        const std::size_t meshes = place.scene.meshes.size();
        if (part < meshes) {
            visit_mesh(place, *place.scene.meshes[part], rays, count);
            return;
        }
        const PlacedScene& placed = place.scene.instances[part - meshes];
        const SceneLevel& outside = job_.level(place.depth);
        SceneLevel& inside = job_.level(place.depth + 1);
        inside.begin(count, !placed.scene->instances.empty());
        for (std::uint32_t k = 0; k < count; ++k) {
            const SceneRaySource& source = outside.sources[rays[k]];
            if ((placed.mask & job_.limits[source.id].mask) != 0)
                enter(line_of(place, outside, rays[k]), source, placed, inside);
        }
        walk(place.depth + 1, *placed.scene, place.number + placed.number);
    }

    void visit_mesh_with_one(const Place& place, const MeshTree& mesh, std::uint32_t ray) {
        SceneLevel& level = job_.level(place.depth);
        if (mesh.tree->empty() || (mesh.mask & job_.limits[level.sources[ray].id].mask) == 0) return;
        level.mesh_stack.reserve(mesh.tree->stats().max_depth);
        const WideBvh::Arrays& arrays = mesh.tree->arrays();
        SimdCounts counts;
        TriangleBlock room;
        Hit hit;
        if (arrays.stats.compact) {
            room = {};
            hit = find_one<any, true, true>(view_of(arrays, room), level.rays[ray],
                                            level.mesh_stack.view(), counts);
        } else {
            hit = find_one<any, false, false>(view_of(arrays, room), level.rays[ray],
                                              level.mesh_stack.view(), counts);
        }
        if (hit.hit()) take(level, mesh, place.number, ray, hit);
    }

    /// `rays` null: all of the level.
    void visit_mesh(const Place& place, const MeshTree& mesh, const std::uint32_t* rays,
                    std::uint32_t count) {
        if (mesh.tree->empty()) return;
        SceneLevel& level = job_.level(place.depth);
        if (count < least_together) {
            for (std::uint32_t k = 0; k < count; ++k)
                visit_mesh_with_one(place, mesh, rays == nullptr ? k : rays[k]);
            return;
        }
        if (mesh.mask != ~std::uint32_t{0}) {
            level.seen.clear();
            for (std::uint32_t k = 0; k < count; ++k) {
                const std::uint32_t ray = rays == nullptr ? k : rays[k];
                if ((mesh.mask & job_.limits[level.sources[ray].id].mask) != 0)
                    level.seen.push_back(ray);
            }
            rays = level.seen.data();
            count = static_cast<std::uint32_t>(level.seen.size());
            if (count == 0) return;
        }
        level.mesh_stack.reserve(mesh.tree->stats().max_depth);
        if (any && level.occluded.size() < level.count) level.occluded.resize(level.count);
        if (!any && level.hits.size() < level.count) level.hits.resize(level.count);
        TriangleBlock room{};
        const SimdJob job{view_of(mesh.tree->arrays(), room),
                          level.rays.data(),
                          rays,
                          count,
                          any ? HitRows{} : HitRows{level.hits.data()},
                          any ? level.occluded.data() : nullptr,
                          level.mesh_stack.view(),
                          level.mesh_stack.packet_view(),
                          &level.mesh_memory,
                          false};
        SimdCounts counts;
        (job_.packets ? job_.kernels->packets : job_.kernels->streams)(job, counts);
        if (counts.hits == 0) return;
        for (std::uint32_t k = 0; k < count; ++k) {
            const std::uint32_t ray = rays == nullptr ? k : rays[k];
            if constexpr (any) {
                if (level.occluded[ray] != 0) take(level, mesh, place.number, ray, {});
            } else {
                if (level.hits[ray].hit()) take(level, mesh, place.number, ray, level.hits[ray]);
            }
        }
    }

    HWY_INLINE void take(SceneLevel& level, const MeshTree& mesh, std::uint32_t number,
                         std::uint32_t ray, const Hit& hit) {
        const SceneRaySource& source = level.sources[ray];
        SceneHit& best = job_.hits[source.id];
        float& reach = job_.limits[source.id].reach;
        if constexpr (any) {
            best.prim = 0;
            reach = level.rays[ray].tmax = -1.0f;
            return;
        }
        SceneHit found{hit, no_primitive, number};
        found.t = static_cast<float>(double{hit.t} * source.scale) + 0.0f;
        if (best.hit() && found.t > best.t) return;
        mesh.name(found);
        const auto key = [](const SceneHit& h) {
            return std::tuple(h.t, h.instance, h.geometry, h.prim);
        };
        if (best.hit() && !(key(found) < key(best))) return;
        best = found;
        // What differs in the line may be equal in the caller's units where those are subnormal: it
        // must be found too.
        reach = found.t < std::numeric_limits<float>::min() ? std::nextafterf(found.t, infinity)
                                                            : found.t;
        shorten(level, ray);
    }

    SceneJob& job_;
};

inline void trace_scene(SceneJob& job) {
    if (job.any)
        SceneWalk<true>(job).run();
    else
        SceneWalk<false>(job).run();
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
