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
#include <numeric>

#include "engine/scene_job.h"
#include "engine/scene_moves.h"
#include "engine/scene_ray.h"
#include "engine/scene_turns.h"
#include "trace/simd/packets.h"
#include "trace/simd/stream.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

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
    static constexpr std::uint32_t least_together = 12;

    /// A scene, where its rays are, and what leads to it.
    struct Place {
        const SceneTree& scene;
        std::size_t depth;
        std::uint32_t number;  // of the path of instances; 0: none
    };

    [[nodiscard]] std::size_t place_of(std::size_t k) const {
        return job_.order == nullptr ? k : job_.order[k];
    }
    /// Ray k of the job; null if it is invalid, or its mask lets it see nothing.
    HWY_INLINE const Ray* start(std::size_t k) {
        constexpr std::size_t ahead = 16;
        if (job_.order != nullptr)
            hwy::Prefetch(job_.rays + place_of(std::min(k + ahead, job_.n - 1)));
        const std::size_t i = place_of(k);
        const Ray& ray = job_.rays[i];
        job_.limits[k] = {ray.tmin, ray.tmax, job_.masks == nullptr ? job_.mask : job_.masks[i]};
        if (is_valid(ray)) return job_.limits[k].mask != 0 ? &ray : nullptr;
        ++job_.invalid;
        return nullptr;
    }

    void one_by_one() {
        if (job_.turns) {
            job_.single_stack.reserve_words(job_.tree->stack_size * rays_in_turn);
            const auto next = [this](std::size_t k) { return start(k); };
            SceneTurns<any, decltype(next)>(job_, next).trace();
            return;
        }
        for (std::size_t k = 0; k < job_.n; ++k) {
            const Ray* const ray = start(k);
            if (ray == nullptr) continue;
            // Rays of a batch that come here go anywhere.
            One one(job_.limits[k], job_.hits[k], job_.single_stack.view(), nullptr, false);
            one.walk(*job_.tree, 0, HWY_NAMESPACE::line_of(*ray));
            one.store(job_, static_cast<std::uint32_t>(k));
        }
    }
    void together() {
        SceneLevel& first = job_.level(0);
        first.begin(job_.n + lanes16, false);
        std::size_t k = 0;
        if (job_.order == nullptr && job_.masks == nullptr && job_.mask != 0)
            for (; k + lanes16 <= job_.n; k += lanes16)
                if (!start_vector(k, first)) start_each(k, k + lanes16, first);
        start_each(k, job_.n, first);
        walk(0, *job_.tree, 0);
    }
    void start_each(std::size_t begin, std::size_t end, SceneLevel& first) {
        for (std::size_t k = begin; k < end; ++k)
            if (const Ray* const ray = start(k))
                add_first(first, *ray, static_cast<std::uint32_t>(k));
    }
    /// Rays k to k + lanes16 - 1, if all of them are valid and near unit length.
    HWY_INLINE bool start_vector(std::size_t k, SceneLevel& first) {
        HWY_ALIGN static constexpr std::int32_t index[16] = {0, 1, 2,  3,  4,  5,  6,  7,
                                                             8, 9, 10, 11, 12, 13, 14, 15};
        const Ray* const rays = job_.rays + k;
        if (!all_usual(classify(read_rays(rays, index)))) return false;
        std::copy_n(rays, lanes16, first.rays.data() + first.count);
        for (std::size_t l = 0; l < lanes16; ++l) {
            job_.limits[k + l] = {rays[l].tmin, rays[l].tmax, job_.mask};
            first.sources[first.count + l] = {1.0, static_cast<std::uint32_t>(k + l)};
        }
        first.count += lanes16;
        return true;
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
            if (count < least_together) {
                for (std::uint32_t k = 0; k < count; ++k) visit_one(leaf, rays[k]);
            } else {
                walk_.visit(place_, tree_.part[leaf], rays, count);
            }
        }
        float reach(std::uint32_t ray) { return walk_.shorten(level_, ray); }
        static constexpr bool nearest_first = true;

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
        source.scale = line_scale(double{longest});
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
        SceneLine line;
        set_line(level.rays[ray], level.sources[ray].scale, line);
        return line;
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

    HWY_INLINE void add(const Place& place, const PlacedScene& placed, std::uint32_t ray,
                        SceneLevel& to) {
        const SceneLevel& from = job_.level(place.depth);
        const std::uint32_t id = from.sources[ray].id;
        if (sees(job_.limits[id].mask, place.scene, placed))
            add(line_of(place, from, ray), id, place.scene, placed, to);
    }
    /// At most lanes16 of them.
    HWY_INLINE void add_vector(const Place& place, const PlacedScene& placed,
                               const std::uint32_t* rays, std::uint32_t count, SceneLevel& to) {
        const SceneLevel& from = job_.level(place.depth);
        HWY_ALIGN std::int32_t index[lanes16];
        bool as_they_are = true;
        for (std::uint32_t l = 0; l < lanes16; ++l)
            index[l] = static_cast<std::int32_t>(rays[std::min(l, count - 1)]);
        for (std::uint32_t l = 0; l < count; ++l) {
            const SceneRaySource& source = from.sources[rays[l]];
            as_they_are = as_they_are && source.scale == 1.0;
            to.sources[to.count + l] = source;
        }
        RayVectors vectors = read_rays(from.rays.data(), index);
        if (as_they_are && move_rays(place.scene, placed, vectors)) {
            const auto quad = [first = &to.rays[to.count].origin.x](std::size_t q) {
                return [=](std::size_t l) { return first + sizeof(Ray) / sizeof(float) * l + q; };
            };
            store_quads(vectors.place, quad(0));
            store_quads(vectors.way, quad(ray_direction));
            to.count += count;
        } else {
            for (std::uint32_t l = 0; l < count; ++l) add(place, placed, rays[l], to);
        }
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
        const SimdJob rays{tree.view,
                           level.rays.data(),
                           nullptr,
                           level.count,
                           {},
                           nullptr,
                           level.parts_stack.view(),
                           level.parts_stack.packet_view(),
                           &level.parts_memory,
                           false};
        Parts parts(*this, place, tree);
        std::uint32_t done = 0;
        if (job_.packets) {
            // Windows of one class go as they are, as in packets.h.
            HWY_ALIGN std::int32_t index[packet_size];
            for (; done + packet_size <= level.count; done += packet_size) {
                std::iota(index, index + packet_size, static_cast<std::int32_t>(done));
                const std::uint32_t code = class_of(rays.rays, index);
                if (code == odd_ray_class) break;
                walk_packets(rays, tree, parts, index, packet_size, code);
            }
        }
        if (done == level.count) return;
        level.seen.resize(level.count);
        std::iota(level.seen.begin(), level.seen.end(), 0u);
        SimdJob rest = rays;
        rest.order = level.seen.data() + done;
        rest.n = level.count - done;
        RaySorter sorter;
        sorter.sort(rest);
        for (std::uint32_t code = 0; code < odd_ray_class; ++code) {
            const std::uint32_t count = sorter.count(code);
            if (count == 0) continue;
            if (job_.packets)
                walk_packets(rays, tree, parts, sorter.rays(code), count, code);
            else
                walk_stream(rays, tree, parts, sorter.rays(code), count, code);
        }
    }
    /// Of a packet's rays; odd_ray_class if they differ.
    static HWY_INLINE std::uint32_t class_of(const Ray* rays, const std::int32_t* index) {
        const auto first = classify(read_rays(rays, index));
        const auto code = hn::Set(I16(), hn::GetLane(first));
        auto same = hn::Eq(first, code);
        for (std::size_t i = lanes16; i < packet_size; i += lanes16)
            same = hn::And(same, hn::Eq(classify(read_rays(rays, index + i)), code));
        return hn::AllTrue(I16(), same) ? static_cast<std::uint32_t>(hn::GetLane(code))
                                        : odd_ray_class;
    }
    void walk_packets(const SimdJob& rays, const PartTree& tree, Parts& parts,
                      const std::int32_t* index, std::uint32_t count, std::uint32_t code) {
        Packet packet;
        SimdCounts counts;
        for (std::uint32_t at = 0; at < count; at += packet_size) {
            const std::int32_t* const here = index + at;
            fill_packet(
                rays.tree, [&](std::size_t i) { return read_rays(rays.rays, here + i); },
                std::min<std::uint32_t>(packet_size, count - at), code, packet, tree.growth);
            PacketWalk<any ? Wanted::any : Wanted::closest, false, false, Parts>(
                rays.tree, packet, here, parts, rays.packet_stack, counts)
                .trace();
        }
    }
    void walk_stream(const SimdJob& rays, const PartTree& tree, Parts& parts,
                     const std::int32_t* index, std::uint32_t count, std::uint32_t code) {
        SimdCounts counts;
        const StreamFrame frame = fill_stream(rays, index, count, code, tree.growth);
        StreamWalk<any, false, false, Parts>(rays.tree, frame, *rays.memory, rays.stack, counts,
                                             &parts, index)
            .trace();
    }

    void visit(const Place& place, std::uint32_t part, const std::uint32_t* rays,
               std::uint32_t count) {
        const std::size_t meshes = place.scene.meshes.size();
        if (part < meshes) {
            visit_mesh(place, *place.scene.meshes[part], rays, count);
            return;
        }
        const PlacedScene& placed = place.scene.placed[part - meshes];
        SceneLevel& inside = job_.level(place.depth + 1);
        inside.begin(count + lanes16, !placed.scene->instances.empty());
        // Floats have all of these rays, and are all that is asked for.
        if (job_.masks == nullptr && place.depth == 0 && placed.scene->instances.empty()) {
            if (!sees(job_.mask, place.scene, placed)) return;
            for (std::uint32_t k = 0; k < count; k += lanes16)
                add_vector(place, placed, rays + k, std::min<std::uint32_t>(lanes16, count - k),
                           inside);
        } else {
            for (std::uint32_t k = 0; k < count; ++k) add(place, placed, rays[k], inside);
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
        const std::size_t stack_size = wide_stack_capacity(mesh.tree->stats().max_depth);
        level.mesh_stack.reserve_words(stack_size * rays_in_turn);
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
                          false,
                          stack_size};
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
