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

#include "engine/scene_all_hits.h"
#include "engine/scene_job.h"
#include "engine/scene_moves.h"
#include "engine/scene_ray.h"
#include "engine/scene_turns.h"
#include "trace/simd/packets.h"
#include "trace/simd/stream.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Closest or any hits.
template <bool any>
class SceneWalk {
public:
    /// `all`: where all hits go instead, without a filter; or null.
    explicit SceneWalk(SceneJob& job, HitsOfJob* all = nullptr) : job_(job), all_(all) {}

    void run() {
        job_.hits.assign(job_.n, {});
        job_.limits.resize(job_.n);
        job_.invalid = 0;
        job_.single_stack.reserve_words(job_.tree->stack_size);
        if (job_.single && all_ == nullptr)
            one_by_one();
        else
            together();
    }

private:
    static constexpr Wanted wanted = any ? Wanted::any : Wanted::closest,
                            accepted = any ? Wanted::any_accepted : Wanted::closest_accepted;
    /// Fewer rays than this go one by one.
    static constexpr std::uint32_t least_together = 12;

    /// A scene, where its rays are, and what leads to it.
    struct Place {
        const SceneTree& scene;
        std::size_t depth;
        std::uint32_t number;  // of the path of instances; 0: none
    };

    [[nodiscard]] bool wants_all() const { return !any && all_ != nullptr; }
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
            if (job_.filter == nullptr)
                SceneTurns<wanted, decltype(next)>(job_, next).trace();
            else
                SceneTurns<accepted, decltype(next)>(job_, next).trace();
            return;
        }
        for (std::size_t k = 0; k < job_.n; ++k) {
            const Ray* const ray = start(k);
            if (ray == nullptr) continue;
            // Rays of a batch that come here go anywhere.
            alone(static_cast<std::uint32_t>(k), false,
                  [&](auto& one) { one.walk(*job_.tree, 0, HWY_NAMESPACE::line_of(*ray)); });
        }
    }
    /// Calls walk(one) for ray `id` of the job.
    template <class Walk>
    HWY_INLINE void alone(std::uint32_t id, bool nearest_first, const Walk& walk) {
        const WideStackView stack = job_.single_stack.view();
        const SceneJob::Limits& limits = job_.limits[id];
        if (wants_all()) {
            const std::size_t before = all_->found().size();
            SceneRay<Wanted::all> one(limits, job_.place(id), {}, stack, &all_->found(),
                                      nearest_first);
            walk(one);
            all_->give(before, id);
        } else if (job_.filter == nullptr) {
            SceneRay<wanted> one(limits, job_.place(id), job_.hits[id], stack, nullptr,
                                 nearest_first);
            walk(one);
            one.store(job_, id);
        } else {
            SceneRay<accepted> one(limits, job_.place(id), job_.hits[id], stack, nullptr,
                                   nearest_first);
            one.filter_by(*job_.filter, job_.ray(id));
            walk(one);
            one.store(job_, id);
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
                if (const auto id = static_cast<std::uint32_t>(k); !add_first(first, *ray, id))
                    alone(id, true, [&](auto& one) {
                        one.walk(*job_.tree, 0, HWY_NAMESPACE::line_of(*ray));
                    });
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

    /// What takes rays on at the leaves of a tree (single.h). Packets and streams through parts and
    /// through shapes have one code.
    class Leaves {
    public:
        static constexpr bool packets_nearest_first = true, large = true;
        const bool nearest_first;

        virtual float visit_one(std::uint32_t first, std::uint32_t count, std::uint32_t ray) = 0;
        virtual void visit(std::uint32_t first, std::uint32_t parts, const std::uint32_t* rays,
                           std::uint32_t count) = 0;
        float reach(std::uint32_t ray) { return walk_.shorten(level_, ray); }
        RAYDIX_PREFETCHING void ask_for(std::uint32_t word) const {
            if (shapes_ != nullptr) ask_for_shapes(*shapes_, word);
        }

    protected:
        /// `shapes`: whose nodes and primitives, which are large, are asked for; or null.
        Leaves(SceneWalk& walk, const Place& place, const ShapeTree* shapes)
            : nearest_first(shapes == nullptr),
              walk_(walk),
              level_(walk.job_.level(place.depth)),
              place_(place),
              shapes_(shapes) {}
        ~Leaves() = default;

        SceneWalk& walk_;
        SceneLevel& level_;
        const Place& place_;

    private:
        const ShapeTree* const shapes_;
    };

    /// Of a tree over parts, one each.
    class Parts final : public Leaves {
        using Leaves::level_, Leaves::place_, Leaves::walk_;

    public:
        Parts(SceneWalk& walk, const Place& place, const PartTree& tree)
            : Leaves(walk, place, nullptr), tree_(tree) {}

        float visit_one(std::uint32_t leaf, std::uint32_t, std::uint32_t ray) override {
            walk_.alone(level_.sources[ray].id, true, [&](auto& one) {
                one.visit(place_.scene, tree_.part[leaf], place_.number,
                          walk_.line_of(place_, level_, ray));
            });
            return this->reach(ray);
        }
        void visit(std::uint32_t leaf, std::uint32_t, const std::uint32_t* rays,
                   std::uint32_t count) override {
            if (count < least_together) {
                for (std::uint32_t k = 0; k < count; ++k) visit_one(leaf, 1, rays[k]);
            } else {
                walk_.visit(place_, tree_.part[leaf], rays, count);
            }
        }

    private:
        const PartTree& tree_;
    };

    /// Of a tree over shapes.
    class AtShapes final : public Leaves {
        using Leaves::level_, Leaves::place_, Leaves::walk_;

    public:
        AtShapes(SceneWalk& walk, const Place& place, const ShapeTree& tree)
            : Leaves(walk, place, &tree), tree_(tree) {}

        float visit_one(std::uint32_t first, std::uint32_t count, std::uint32_t ray) override {
            if (const UserGeometry* const user = tree_.user()) {
                visit_user(*user, first, &ray, 1);
            } else {
                ShapeRay at = shape_ray(ray);
                hit_leaf(tree_, first, count, at, [&](const TreeHit& hit) {
                    if (!take(ray, hit, at.scale)) return false;
                    at.end_at(limits(ray).reach);
                    return any;
                });
            }
            return this->reach(ray);
        }
        void visit(std::uint32_t first, std::uint32_t parts, const std::uint32_t* rays,
                   std::uint32_t count) override {
            if (const UserGeometry* const user = tree_.user()) {
                visit_user(*user, first, rays, count);
            } else {
                for (std::uint32_t k = 0; k < count; ++k) visit_one(first, parts, rays[k]);
            }
        }

    private:
        [[nodiscard]] SceneJob::Limits& limits(std::uint32_t ray) {
            return walk_.job_.limits[level_.sources[ray].id];
        }
        HWY_INLINE ShapeRay shape_ray(std::uint32_t ray) {
            const SceneRaySource& source = level_.sources[ray];
            return {level_.rays[ray], source.scale, walk_.job_.place(source.id)};
        }
        /// Whether it counts, and is the best.
        HWY_INLINE bool take(std::uint32_t ray, const TreeHit& hit, double scale) {
            const std::uint32_t id = level_.sources[ray].id;
            if (walk_.wants_all()) {
                walk_.all_->add(tree_, place_.number, scale, hit, id);
                return false;
            }
            if (walk_.job_.filter != nullptr &&
                !walk_.job_.accepts(id, hit_in_scene(tree_, place_.number, scale, hit)))
                return false;
            return keep<any>(tree_, place_.number, scale, hit, walk_.job_.hits[id],
                             walk_.job_.limits[id].reach);
        }
        /// The rays of a list that still go on, to one primitive.
        HWY_NOINLINE void visit_user(const UserGeometry& user, std::uint32_t prim,
                                     const std::uint32_t* rays, std::uint32_t count) {
            UserRays& listed = walk_.job_.user_rays;
            listed.begin(count);
            for (std::uint32_t k = 0; k < count; ++k) {
                const SceneRaySource& source = level_.sources[rays[k]];
                const SceneJob::Limits& limits = walk_.job_.limits[source.id];
                const UserRay given(level_.rays[rays[k]], source.scale, limits.tmin, limits.reach);
                if (given.ray.tmin <= given.ray.tmax)
                    listed.add(given.ray, given.scale, rays[k], walk_.job_.place(source.id));
            }
            if (listed.count() == 0) return;
            RaysAtPrimitive at = listed.at_primitive();
            user.test(prim, at);
            for (std::uint32_t k = 0; k < listed.count(); ++k) {
                TreeHit hit = listed.hit(k);
                if (!hit.hit()) continue;
                hit.prim = prim;
                if (take(listed.number(k), hit, listed.scale(k)))
                    walk_.shorten(level_, listed.number(k));
            }
        }

        const ShapeTree& tree_;
    };

    /// Ends a ray where its best hit is; how far it goes.
    HWY_INLINE float shorten(SceneLevel& level, std::size_t ray) {
        const SceneRaySource& source = level.sources[ray];
        const float reach = end_in_units(source.scale, job_.limits[source.id].reach);
        level.rays[ray].tmax = reach;
        return min_of(reach, std::numeric_limits<float>::max());
    }

    /// A ray as the caller has it becomes the last one of a level. False, and nothing, if parts and
    /// meshes need different scales of it.
    HWY_INLINE bool add_first(SceneLevel& level, const Ray& ray, std::uint32_t id) {
        level.rays[level.count] = ray;
        level.sources[level.count] = {1.0, id};
        const Vec3 d = ray.direction;
        const float longest = max_of(max_of(std::fabs(d.x), std::fabs(d.y)), std::fabs(d.z));
        const bool taken = near_unit_length(longest) || rescale(longest, level.rays[level.count],
                                                                level.sources[level.count].scale);
        level.count += static_cast<std::size_t>(taken);
        return taken;
    }

    /// Ray `ray` of one level, in double.
    [[nodiscard]] HWY_INLINE SceneLine line_of(const Place& place, const SceneLevel& level,
                                               std::uint32_t ray) const {
        if (place.depth != 0 && !place.scene.instances.empty()) return level.lines[ray];
        const SceneRaySource& source = level.sources[ray];
        // Scaled, its smaller components may be less than floats have.
        if (place.depth == 0 && source.scale != 1.0)
            return HWY_NAMESPACE::line_of(job_.ray(source.id));
        // Floats have all of it: the caller's, or that of a scene that holds no instances.
        SceneLine line;
        set_line(level.rays[ray], source.scale, line);
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
        ray.tmin = line.start(limits.tmin);
        ray.tmax = line.end(limits.reach);
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
            as_they_are =
                as_they_are && (source.scale == 1.0 || keeps_digits(from.rays[rays[l]].direction,
                                                                    job_.ray(source.id).direction));
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
        } else if (const ShapeTree* const shapes = scene.only_shapes()) {
            visit_shapes(place, *shapes, nullptr, count);
        } else {
            for (const PartTree* const tree : {&scene.near, &scene.wild}) {
                if (tree->empty()) continue;
                Parts parts(*this, place, *tree);
                walk_tree(place, *tree, parts, level.parts_stack, level.parts_memory, nullptr,
                          count);
            }
        }
    }

    void walk_one(const Place& place, std::uint32_t ray) {
        const SceneLevel& level = job_.level(place.depth);
        alone(level.sources[ray].id, true,
              [&](auto& one) { one.walk(place.scene, place.number, line_of(place, level, ray)); });
    }

    /// Rays list[0] to list[count - 1] of a level, or its first `count`, through a tree over parts
    /// or shapes. The list is not needed once leaves are visited.
    HWY_NOINLINE void walk_tree(const Place& place, const PartTree& tree, Leaves& leaves,
                                StackMemory& stack, StreamMemory& memory, const std::uint32_t* list,
                                std::uint32_t count) {
        SceneLevel& level = job_.level(place.depth);
        stack.reserve(tree.arrays.stats.max_depth);
        const SimdJob rays{tree.view,    level.rays.data(),   list,    count, {}, nullptr,
                           stack.view(), stack.packet_view(), &memory, false};
        std::uint32_t done = 0;
        if (job_.packets && list == nullptr) {
            // Windows of one class go as they are, as in packets.h.
            HWY_ALIGN std::int32_t index[packet_size];
            for (; done + packet_size <= count; done += packet_size) {
                std::iota(index, index + packet_size, static_cast<std::int32_t>(done));
                const std::uint32_t code = class_of(rays.rays, index);
                if (code == odd_ray_class) break;
                walk_packets(rays, tree, leaves, index, packet_size, code);
            }
        }
        if (done == count) return;
        SimdJob rest = rays;
        if (list == nullptr) {
            level.seen.resize(count);
            std::iota(level.seen.begin(), level.seen.end(), 0u);
            rest.order = level.seen.data() + done;
            rest.n = count - done;
        }
        RaySorter sorter;
        sorter.sort(rest);
        for (std::uint32_t code = 0; code < odd_ray_class; ++code) {
            const std::uint32_t same = sorter.count(code);
            if (same == 0) continue;
            if (job_.packets)
                walk_packets(rays, tree, leaves, sorter.rays(code), same, code);
            else
                walk_stream(rays, tree, leaves, sorter.rays(code), same, code);
        }
    }
    void walk_packets(const SimdJob& rays, const PartTree& tree, Leaves& leaves,
                      const std::int32_t* index, std::uint32_t count, std::uint32_t code) {
        Packet packet;
        PacketRays read;
        SimdCounts counts;
        for (std::uint32_t at = 0; at < count; at += packet_size) {
            const std::int32_t* const here = index + at;
            const auto size = std::min<std::uint32_t>(packet_size, count - at);
            read_packet(rays.rays, here, size, read);
            fill_packet(rays.tree, read, size, code, packet, tree.growth);
            PacketWalk<any ? Wanted::any : Wanted::closest, false, false, Leaves>(
                rays.tree, packet, here, leaves, rays.packet_stack, counts)
                .trace();
        }
    }
    void walk_stream(const SimdJob& rays, const PartTree& tree, Leaves& leaves,
                     const std::int32_t* index, std::uint32_t count, std::uint32_t code) {
        SimdCounts counts;
        const StreamFrame frame = fill_stream(rays, index, count, code, tree.growth);
        StreamWalk<any, false, false, Leaves>(rays.tree, frame, *rays.memory, rays.stack, counts,
                                              &leaves, index)
            .trace();
    }

    void visit(const Place& place, std::uint32_t part, const std::uint32_t* rays,
               std::uint32_t count) {
        const std::size_t meshes = place.scene.meshes.size();
        if (part < meshes) {
            visit_mesh(place, *place.scene.meshes[part], rays, count);
            return;
        }
        const std::size_t own = place.scene.own_part_count();
        if (part < own) {
            visit_shapes(place, *place.scene.shapes[part - meshes], rays, count);
            return;
        }
        const PlacedScene& placed = place.scene.placed[part - own];
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

    /// Leaves out rays that do not see a mask, in a list of the level's; whether any are left.
    HWY_INLINE bool keep_seeing(SceneLevel& level, std::uint32_t mask, const std::uint32_t*& rays,
                                std::uint32_t& count) {
        if (mask == ~std::uint32_t{0}) return count != 0;
        level.seen.clear();
        for (std::uint32_t k = 0; k < count; ++k) {
            const std::uint32_t ray = rays == nullptr ? k : rays[k];
            if ((mask & job_.limits[level.sources[ray].id].mask) != 0) level.seen.push_back(ray);
        }
        rays = level.seen.data();
        count = static_cast<std::uint32_t>(level.seen.size());
        return count != 0;
    }

    /// `rays` null: all of the level.
    void visit_shapes(const Place& place, const ShapeTree& shapes, const std::uint32_t* rays,
                      std::uint32_t count) {
        SceneLevel& level = job_.level(place.depth);
        if (shapes.empty() || !keep_seeing(level, shapes.mask, rays, count)) return;
        AtShapes leaves(*this, place, shapes);
        walk_tree(place, shapes, leaves, level.mesh_stack, level.mesh_memory, rays, count);
    }
    /// `rays` null: all of the level.
    void visit_mesh(const Place& place, const MeshTree& mesh, const std::uint32_t* rays,
                    std::uint32_t count) {
        if (mesh.tree->empty()) return;
        SceneLevel& level = job_.level(place.depth);
        if (!keep_seeing(level, mesh.mask, rays, count)) return;
        const std::size_t stack_size = wide_stack_capacity(mesh.tree->stats().max_depth);
        level.mesh_stack.reserve_words(stack_size * rays_in_turn);
        if (any && level.occluded.size() < level.count) level.occluded.resize(level.count);
        if (!any && !wants_all() && level.hits.size() < level.count) level.hits.resize(level.count);
        TriangleBlock room{};
        WideView view = mesh.view;
        view.room = &room;
        const MeshCheck context{*this, level, mesh, place.number};
        const HitCheck check{&MeshCheck::accepts, &context};
        const SimdJob job{view,
                          level.rays.data(),
                          rays,
                          count,
                          any ? HitRows() : HitRows(level.hits.data()),
                          any ? level.occluded.data() : nullptr,
                          level.mesh_stack.view(),
                          level.mesh_stack.packet_view(),
                          &level.mesh_memory,
                          false,
                          stack_size,
                          nullptr,
                          nullptr,
                          job_.filter == nullptr ? nullptr : &check};
        SimdCounts counts;
        if (wants_all()) {
            all_->trace_mesh(job, level, mesh, place.number,
                             count < least_together || view.local_pads ? job_.kernels->single
                                                                       : job_.kernels->packets);
            return;
        }
        // Streams have no checks.
        (count < least_together || view.local_pads ? job_.kernels->single
         : job_.packets || job_.filter != nullptr  ? job_.kernels->packets
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

    /// Asks the filter about hits of a mesh.
    struct MeshCheck {
        const SceneWalk& walk;
        const SceneLevel& level;
        const MeshTree& mesh;
        std::uint32_t number;

        static bool accepts(const void* context, const Ray* ray, const TreeHit& hit) {
            const auto& check = *static_cast<const MeshCheck*>(context);
            const SceneRaySource& source =
                check.level.sources[static_cast<std::size_t>(ray - check.level.rays.data())];
            return check.walk.job_.accepts(
                source.id, hit_in_scene(check.mesh, check.number, source.scale, hit));
        }
    };

    HWY_INLINE void take(SceneLevel& level, const MeshTree& mesh, std::uint32_t number,
                         std::uint32_t ray, const TreeHit& hit) {
        const SceneRaySource& source = level.sources[ray];
        if (keep<any>(mesh, number, source.scale, hit, job_.hits[source.id],
                      job_.limits[source.id].reach))
            shorten(level, ray);
    }

    SceneJob& job_;
    HitsOfJob* const all_;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
