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

#include <algorithm>
#include <limits>

#include "engine/hit_order.h"
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

/// A hit of a mesh takes the place of the best one if it is the less of the two; `reach` is how far
/// the ray goes then. Whether it does.
template <bool any>
HWY_INLINE bool keep(const MeshTree& mesh, std::uint32_t number, double scale, const TreeHit& hit,
                     Hit& best, float& reach) {
    if constexpr (any) {
        best.prim = 0;
        reach = -1.0f;
        return true;
    }
    Hit found{hit, no_primitive, number};
    if (scale != 1.0) found.t = static_cast<float>(double{hit.t} * scale) + 0.0f;
    if (best.hit() && found.t > best.t) return false;
    mesh.name(found);
    if (best.hit() && !(order_of(found) < order_of(best))) return false;
    best = found;
    // What differs in the line may be equal in the caller's units where those are subnormal: it
    // must be found too.
    reach =
        found.t < std::numeric_limits<float>::min() ? std::nextafterf(found.t, infinity) : found.t;
    return true;
}

HWY_INLINE bool near_unit_length(double longest) { return longest > 0x1p-3 && longest < 0x1p3; }

/// The caller's ray.
HWY_INLINE SceneLine line_of(const Ray& ray) {
    const Double3 o(ray.origin), d(ray.direction);
    SceneLine line{{o.x, o.y, o.z, 0}, {d.x, d.y, d.z, 0}, 1.0};
    const Vec3 way = ray.direction;
    const double longest = max_of(max_of(std::fabs(way.x), std::fabs(way.y)), std::fabs(way.z));
    if (!near_unit_length(longest)) {
        line.scale = direction_scale(longest);
        for (int a = 0; a < 3; ++a) line.direction[a] *= line.scale;
    }
    return line;
}

/// Through the inverse of an instance: ((x + y) + z) + move, nothing fused. `from` may be `to`.
HWY_INLINE void enter(const SceneLine& from, const WayIn& way, SceneLine& to) {
    const hn::CappedTag<double, 4> d;
    const double o[3] = {from.origin[0], from.origin[1], from.origin[2]},
                 v[3] = {from.direction[0], from.direction[1], from.direction[2]};
    for (std::size_t l = 0; l < 4; l += hn::MaxLanes(d)) {
        const auto x = hn::Load(d, way.columns[0] + l), y = hn::Load(d, way.columns[1] + l),
                   z = hn::Load(d, way.columns[2] + l);
        const auto turned = [&](const double* by) {
            return hn::Add(hn::Add(hn::Mul(x, hn::Set(d, by[0])), hn::Mul(y, hn::Set(d, by[1]))),
                           hn::Mul(z, hn::Set(d, by[2])));
        };
        hn::Store(hn::Add(turned(o), hn::Load(d, way.columns[3] + l)), d, to.origin + l);
        hn::Store(turned(v), d, to.direction + l);
    }
    const double longest = max_of(max_of(std::fabs(to.direction[0]), std::fabs(to.direction[1])),
                                  std::fabs(to.direction[2]));
    to.scale = from.scale;
    if (!near_unit_length(longest)) {
        const double by = direction_scale(longest);
        for (int a = 0; a < 3; ++a) to.direction[a] *= by;
        to.scale *= by;
    }
}

/// Into a placed scene, by all of its instances in turn.
HWY_INLINE void enter(const SceneLine& from, const SceneTree& scene, const PlacedScene& placed,
                      SceneLine& to) {
    enter(from, placed.way, to);
    for (std::uint32_t k = 0; k < placed.more; ++k) enter(to, scene.ways[placed.first + k], to);
}

/// Whether rays of a mask see all instances on the way.
HWY_INLINE bool sees(std::uint32_t mask, const SceneTree& scene, const PlacedScene& placed) {
    bool seen = (placed.way.mask & mask) != 0;
    for (std::uint32_t k = 0; k < placed.more; ++k)
        seen = seen && (scene.ways[placed.first + k].mask & mask) != 0;
    return seen;
}

/// As floats; a fourth one has no meaning.
template <class D = hn::CappedTag<double, 4>>
HWY_INLINE V4 rounded(const double* from) {
    const D d;
    if constexpr (hn::MaxLanes(d) == 4) {
        return hn::DemoteTo(f4, hn::Load(d, from));
    } else {
        alignas(16) float out[4];
        for (int a = 0; a < 4; ++a) out[a] = static_cast<float>(from[a]);
        return hn::Load(f4, out);
    }
}

/// One ray through a scene; counting: the nodes that it visits too.
template <Wanted wanted, bool counting = false>
class SceneRay {
public:
    /// `stack` has room for SceneTree::stack_size; `best` is what was found before; `found` is for
    /// all hits.
    SceneRay(const SceneJob::Limits& limits, const Hit& best, const WideStackView& stack,
             BudgetVector<Hit>* found = nullptr)
        : tmin_(limits.tmin),
          reach_(limits.reach),
          mask_(limits.mask),
          best_(best),
          stack_(stack),
          found_(found) {}

    [[nodiscard]] const Hit& best() const { return best_; }
    void store(SceneJob& job, std::uint32_t id) const {
        job.limits[id].reach = reach_;
        job.hits[id] = best_;
    }
    [[nodiscard]] std::uint64_t visits() const { return visits_; }

    void walk(const SceneTree& scene, std::uint32_t number, const SceneLine& line) {
        if (const MeshTree* const mesh = scene.only_mesh()) {
            if (!mesh->tree->empty()) hit_mesh(*mesh, number, line);
            return;
        }
        for (const PartTree* const tree : {&scene.near, &scene.wild})
            if (!tree->empty()) walk_parts(scene, *tree, number, line);
    }

    /// Part `part` of a scene.
    HWY_INLINE void visit(const SceneTree& scene, std::uint32_t part, std::uint32_t number,
                          const SceneLine& line) {
        const std::size_t meshes = scene.meshes.size();
        if (part < meshes) {
            hit_mesh(*scene.meshes[part], number, line);
            return;
        }
        const PlacedScene& placed = scene.placed[part - meshes];
        if (!sees(mask_, scene, placed)) return;
        SceneLine inside;
        enter(line, scene, placed, inside);
        number += placed.number;
        if (placed.mesh != nullptr)
            hit_mesh(*placed.mesh, number, inside);
        else
            walk(*placed.scene, number, inside);
    }

private:
    struct Parts {
        SceneRay& ray;
        const SceneTree& scene;
        const PartTree& tree;
        std::uint32_t number;
        const SceneLine& line;

        HWY_NOINLINE float visit_one(std::uint32_t leaf, std::uint32_t) {
            ray.visit(scene, tree.part[leaf], number, line);
            return min_of(line.units(ray.reach_), std::numeric_limits<float>::max());
        }
    };

    HWY_NOINLINE void walk_parts(const SceneTree& scene, const PartTree& tree, std::uint32_t number,
                                 const SceneLine& line) {
        SingleFrame frame;
        if (!fill(tree.view, line, frame)) return;
        grow_pads(tree.view, tree.growth, frame);
        const WideStackView stack = stack_;
        const std::size_t taken = wide_stack_capacity(tree.arrays.stats.max_depth);
        stack_ = {stack.words + taken, stack.entries + taken};
        Parts parts{*this, scene, tree, number, line};
        SimdCounts counts;
        SingleRay<wanted, counting, false, false, Parts>(tree.view, frame, stack, counts, &parts, 0)
            .trace(0, {frame.tmax});
        if constexpr (counting) visits_ += counts.visits;
        stack_ = stack;
    }

    /// False if floats do not hold the ray, or it ends before it begins.
    HWY_INLINE bool fill(const WideView& view, const SceneLine& line, SingleFrame& frame) const {
        const V4 origin = rounded(line.origin), way = rounded(line.direction);
        const V4 most = hn::Set(f4, std::numeric_limits<float>::max());
        const float tmin = line.units(tmin_), tmax = line.units(reach_);
        if ((bits_of(f4, hn::And(hn::Le(hn::Abs(origin), most), hn::Le(hn::Abs(way), most))) & 7) !=
                7 ||
            !(tmin <= tmax && tmax >= 0.0f))
            return false;
        alignas(16) float components[4];
        hn::Store(way, f4, components);
        fill_usual_frame(view, origin, way, components, tmin, tmax, frame);
        return true;
    }

    /// Of a mesh that is not empty.
    HWY_INLINE void hit_mesh(const MeshTree& mesh, std::uint32_t number, const SceneLine& line) {
        if ((mesh.mask & mask_) == 0) return;
        SingleFrame frame;
        if (!fill(mesh.view, line, frame)) return;
        if (mesh.view.is_compact) {
            TriangleBlock room{};
            WideView view = mesh.view;
            view.room = &room;
            search<true>(mesh, view, frame, number, line.scale);
        } else {
            search<false>(mesh, mesh.view, frame, number, line.scale);
        }
    }

    template <bool compact>
    HWY_INLINE void search(const MeshTree& mesh, const WideView& view, const SingleFrame& frame,
                           std::uint32_t number, double scale) {
        constexpr bool counted = compact || counting;
        SimdCounts counts;
        if constexpr (wanted == Wanted::all) {
            const std::size_t before = found_->size();
            SingleRay<wanted, counted, compact>(view, frame, stack_, counts).trace_all(*found_);
            for (std::size_t k = before; k < found_->size(); ++k) {
                Hit& hit = (*found_)[k];
                hit.t = static_cast<float>(double{hit.t} * scale) + 0.0f;
                hit.instance = number;
                mesh.name(hit);
            }
        } else {
            const WideBest best = SingleRay<wanted, counted, compact>(view, frame, stack_, counts)
                                      .trace(0, {frame.tmax});
            if (best.found())
                keep<wanted == Wanted::any>(mesh, number, scale,
                                            {best.t, best.prim, best.u, best.v}, best_, reach_);
        }
        if constexpr (counting) visits_ += counts.visits;
    }

    const float tmin_;
    float reach_;
    const std::uint32_t mask_;
    Hit best_;
    std::uint64_t visits_ = 0;
    WideStackView stack_;  // from where it is free
    BudgetVector<Hit>* const found_;
};

template <bool any>
class SceneWalk {
public:
    explicit SceneWalk(SceneJob& job) : job_(job) {}

    void run() {
        job_.hits.assign(job_.n, {});
        job_.limits.resize(job_.n);
        job_.invalid = 0;
        job_.single_stack.reserve_words(job_.tree->stack_size);
        if (job_.single)
            one_by_one();
        else
            together();
    }

private:
    using One = SceneRay<any ? Wanted::any : Wanted::closest>;
    /// Fewer rays than this go one by one.
    static constexpr std::uint32_t least_together = 6;

    /// A scene, where its rays are, and what leads to it.
    struct Place {
        const SceneTree& scene;
        std::size_t depth;
        std::uint32_t number;  // of the path of instances; 0: none
    };

    [[nodiscard]] std::size_t place_of(std::size_t k) const {
        return job_.order == nullptr ? k : job_.order[k];
    }
    /// Ray k of the job; null if it is invalid.
    HWY_INLINE const Ray* start(std::size_t k) {
        constexpr std::size_t ahead = 16;
        if (job_.order != nullptr)
            hwy::Prefetch(job_.rays + place_of(std::min(k + ahead, job_.n - 1)));
        const std::size_t i = place_of(k);
        const Ray& ray = job_.rays[i];
        job_.limits[k] = {ray.tmin, ray.tmax, job_.masks == nullptr ? job_.mask : job_.masks[i]};
        if (is_valid(ray)) return &ray;
        ++job_.invalid;
        return nullptr;
    }

    void one_by_one() {
        for (std::size_t k = 0; k < job_.n; ++k) {
            const Ray* const ray = start(k);
            if (ray == nullptr) continue;
            const auto id = static_cast<std::uint32_t>(k);
            One one(job_.limits[k], job_.hits[k], job_.single_stack.view());
            one.walk(*job_.tree, 0, HWY_NAMESPACE::line_of(*ray));
            one.store(job_, id);
        }
    }
    void together() {
        SceneLevel& first = job_.level(0);
        first.begin(job_.n, false);
        for (std::size_t k = 0; k < job_.n; ++k)
            if (const Ray* const ray = start(k))
                add_first(first, *ray, static_cast<std::uint32_t>(k));
        walk(0, *job_.tree, 0);
    }

    /// What takes rays on at the leaves of a tree over parts (single.h).
    class Parts {
    public:
        Parts(SceneWalk& walk, const Place& place, const PartTree& tree)
            : walk_(walk), level_(walk.job_.level(place.depth)), place_(place), tree_(tree) {}

        float visit_one(std::uint32_t leaf, std::uint32_t ray) {
            const std::uint32_t id = level_.sources[ray].id;
            SceneJob& job = walk_.job_;
            One one(job.limits[id], job.hits[id], job.single_stack.view());
            one.visit(place_.scene, tree_.part[leaf], place_.number,
                      walk_.line_of(place_, level_, ray));
            one.store(job, id);
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
        if (place.depth != 0 && !place.scene.instances.empty()) return level.lines[ray];
        // Floats have all of it: the caller's, or that of a scene that holds no instances.
        const Double3 o(level.rays[ray].origin), d(level.rays[ray].direction);
        return {{o.x, o.y, o.z, 0}, {d.x, d.y, d.z, 0}, level.sources[ray].scale};
    }

    /// A ray goes through the inverse of an instance. It becomes the last one of the level inside,
    /// unless it can hit nothing there.
    HWY_INLINE void add(const SceneLine& from, std::uint32_t id, const SceneTree& scene,
                        const PlacedScene& placed, SceneLevel& to) {
        SceneLine line;
        enter(from, scene, placed, line);
        const SceneJob::Limits& limits = job_.limits[id];
        Ray& ray = to.rays[to.count];
        alignas(16) float origin[4], direction[4];
        hn::Store(rounded(line.origin), f4, origin);
        hn::Store(rounded(line.direction), f4, direction);
        ray.origin = {origin[0], origin[1], origin[2]};
        ray.direction = {direction[0], direction[1], direction[2]};
        ray.tmin = line.units(limits.tmin);
        ray.tmax = line.units(limits.reach);
        if (!is_valid(ray)) return;
        if (!placed.scene->instances.empty()) to.lines[to.count] = line;
        to.sources[to.count++] = {line.scale, id};
    }

    /// All rays of the level of `place`.
    void walk(std::size_t depth, const SceneTree& scene, std::uint32_t number) {
        const Place place{scene, depth, number};
        SceneLevel& level = job_.level(depth);
        const auto count = static_cast<std::uint32_t>(level.count);
        if (count < least_together) {
            for (std::uint32_t ray = 0; ray < count; ++ray) walk_one(place, ray);
        } else if (const MeshTree* const mesh = scene.only_mesh()) {
            visit_mesh(place, *mesh, nullptr, count);
        } else {
            for (const PartTree* const tree : {&scene.near, &scene.wild})
                if (!tree->empty()) walk_parts(place, *tree);
        }
    }

    void walk_one(const Place& place, std::uint32_t ray) {
        const SceneLevel& level = job_.level(place.depth);
        const std::uint32_t id = level.sources[ray].id;
        One one(job_.limits[id], job_.hits[id], job_.single_stack.view());
        one.walk(place.scene, place.number, line_of(place, level, ray));
        one.store(job_, id);
    }

    HWY_NOINLINE void walk_parts(const Place& place, const PartTree& tree) {
        SceneLevel& level = job_.level(place.depth);
        level.parts_stack.reserve(tree.arrays.stats.max_depth);
        const SimdJob rays{
            tree.view, level.rays.data(),        nullptr, level.count,         {},
            nullptr,   level.parts_stack.view(), {},      &level.parts_memory, false};
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

    void visit(const Place& place, std::uint32_t part, const std::uint32_t* rays,
               std::uint32_t count) {
        const std::size_t meshes = place.scene.meshes.size();
        if (part < meshes) {
            visit_mesh(place, *place.scene.meshes[part], rays, count);
            return;
        }
        const PlacedScene& placed = place.scene.placed[part - meshes];
        const SceneLevel& outside = job_.level(place.depth);
        SceneLevel& inside = job_.level(place.depth + 1);
        inside.begin(count, !placed.scene->instances.empty());
        for (std::uint32_t k = 0; k < count; ++k) {
            const std::uint32_t id = outside.sources[rays[k]].id;
            if (sees(job_.limits[id].mask, place.scene, placed))
                add(line_of(place, outside, rays[k]), id, place.scene, placed, inside);
        }
        walk(place.depth + 1, *placed.scene, place.number + placed.number);
    }

    /// `rays` null: all of the level.
    void visit_mesh(const Place& place, const MeshTree& mesh, const std::uint32_t* rays,
                    std::uint32_t count) {
        if (mesh.tree->empty()) return;
        SceneLevel& level = job_.level(place.depth);
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
        WideView view = mesh.view;
        view.room = &room;
        const SimdJob job{view,
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
        (count < least_together ? job_.kernels->single
         : job_.packets         ? job_.kernels->packets
                                : job_.kernels->streams)(job, counts);
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
                         std::uint32_t ray, const TreeHit& hit) {
        const SceneRaySource& source = level.sources[ray];
        if (keep<any>(mesh, number, source.scale, hit, job_.hits[source.id],
                      job_.limits[source.id].reach))
            shorten(level, ray);
    }

    SceneJob& job_;
};

/// All hits of the rays of a job, one ray after the other.
inline void all_scene_hits(SceneJob& job) {
    job.invalid = 0;
    job.single_stack.reserve_words(job.tree->stack_size);
    for (std::size_t k = 0; k < job.n; ++k) {
        const Ray& ray = job.rays[k];
        const std::size_t before = job.found->size();
        if (is_valid(ray)) {
            SceneRay<Wanted::all>(
                {ray.tmin, ray.tmax, job.masks == nullptr ? job.mask : job.masks[k]}, {},
                job.single_stack.view(), job.found)
                .walk(*job.tree, 0, line_of(ray));
            finish_scene_ray(*job.found, before);
        } else {
            ++job.invalid;
        }
        job.hit_counts[k] = job.found->size() - before;
    }
}

/// Closest hits, one ray after the other: how many nodes each visits, those over parts included.
inline void count_scene_steps(SceneJob& job) {
    job.single_stack.reserve_words(job.tree->stack_size);
    for (std::size_t k = 0; k < job.n; ++k) {
        const Ray& ray = job.rays[k];
        job.visits[k] = 0;
        if (!is_valid(ray)) continue;
        SceneRay<Wanted::closest, true> one({ray.tmin, ray.tmax, job.mask}, {},
                                            job.single_stack.view());
        one.walk(*job.tree, 0, line_of(ray));
        job.visits[k] = static_cast<std::uint32_t>(one.visits());
    }
}

/// A valid ray alone; for any hit only prim has a meaning.
template <bool any>
Hit hit_of_scene(const SceneTree& scene, const Ray& ray, std::uint32_t mask,
                 const WideStackView& stack) {
    SceneRay<any ? Wanted::any : Wanted::closest> one({ray.tmin, ray.tmax, mask}, {}, stack);
    one.walk(scene, 0, line_of(ray));
    return one.best();
}

inline void trace_scene(SceneJob& job) {
    if (job.any)
        SceneWalk<true>(job).run();
    else
        SceneWalk<false>(job).run();
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
