// Rays in double through a scene that take turns, as scene_turns.h in float: a node of the tree
// over parts or of a mesh's, a leaf of triangles, or the way into a part. Included once per
// instruction set.
#if defined(RAYDIX_ENGINE_SCENE_TURNS_DOUBLE_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_SCENE_TURNS_DOUBLE_H
#undef RAYDIX_ENGINE_SCENE_TURNS_DOUBLE_H
#else
#define RAYDIX_ENGINE_SCENE_TURNS_DOUBLE_H
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <optional>
#include <type_traits>

#include "engine/scene_ray_double.h"
#include "trace/simd/turns.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// A ray that stands somewhere in a scene.
template <bool any>
class StandingRayD : SceneRayD<any ? Wanted::any : Wanted::closest> {
    static constexpr Wanted wanted = any ? Wanted::any : Wanted::closest;
    using Walk = SceneRayD<wanted>;
    using Leaves = TriangleLeavesD<wanted>;
    // Through the parts too, whose leaves it does not visit.
    using One = TurnRay<wanted, false, false, Leaves>;

public:
    /// `scene` and `ray`, which must be valid, stay where they are; `stack` has room for
    /// SceneTreeD::stack_size.
    StandingRayD(const SceneTreeD& scene, const RayD& ray, std::size_t place, std::uint32_t mask,
                 const WideStackView& stack)
        : Walk(ray, place, mask, stack), scene_(scene), line_(ray), parts_stack_(stack) {
        const std::size_t taken = wide_stack_capacity(scene.parts.arrays.stats.max_depth);
        this->stack_ = stack.from(taken);
    }

    using Walk::best;

    /// Whether there is anything to do.
    bool begin(const RayD& ray) {
        if (const MeshTreeD* const mesh = scene_.only_mesh()) return enter_mesh(*mesh, 0, ray);
        const PartTreeD& parts = scene_.parts;
        if (parts.empty()) return false;
        const RayFrameD frame = make_frame(ray);
        t_scale_ = frame.t_scale;
        if (!fill_box_frame(parts, ray, frame, parts.around.error, parts_frame_, distances_))
            return false;
        parts_.emplace(parts.view, parts_frame_, parts_stack_, counts_);
        now_ = &*parts_;
        return now_->begin(parts_frame_.tmax);
    }

    [[nodiscard]] TurnKind kind() const {
        const std::uint32_t leaf = now_->next() >> 31;
        return static_cast<TurnKind>(leaf + (leaf & static_cast<std::uint32_t>(!in_mesh_)));
    }
    HWY_INLINE void ask() const {
        if (in_mesh_)
            leaves_->ask_for(now_->next());
        else if (kind() == TurnKind::node)
            ask_for_all(scene_.parts.view.nodes[now_->next()]);
        else if (part() >= scene_.own_part_count())
            ask_for_all(scene_.placed[part() - scene_.own_part_count()]);
    }
    template <TurnKind kind>
    HWY_INLINE bool look(std::integral_constant<TurnKind, kind> what) {
        return now_->look(what);
    }
    HWY_INLINE void try_hit() { now_->try_hit(); }
    HWY_INLINE void keep_hit() { now_->keep_hit(); }
    HWY_INLINE bool step(std::integral_constant<TurnKind, TurnKind::node>) {
        return now_->step_node() || leave();
    }
    HWY_INLINE bool step(std::integral_constant<TurnKind, TurnKind::leaf>) {
        return now_->step_leaf() || leave();
    }
    HWY_INLINE bool step(std::integral_constant<TurnKind, TurnKind::part>) {
        return enter_part(part()) || go_on();
    }

private:
    [[nodiscard]] std::uint32_t part() const {
        return scene_.parts.part[(now_->next() & ~wide_leaf_bit) >> 3];
    }

    /// What the ray visits in turns, if it is a mesh; all else at once. Whether it stands in one.
    HWY_NOINLINE bool enter_part(std::uint32_t part) {
        if (part < scene_.meshes.size()) return enter_mesh(*scene_.meshes[part], 0, line_);
        const std::size_t own = scene_.own_part_count();
        if (part < own) {
            this->hit_shapes(*scene_.shapes[part - scene_.meshes.size()], 0, line_);
            return false;
        }
        const PlacedSceneD& placed = scene_.placed[part - own];
        if (!this->sees(scene_, placed)) return false;
        const LineD inside = line_into(line_, scene_, placed);
        if (const MeshTreeD* const mesh = placed.scene->only_mesh())
            return enter_mesh(*mesh, placed.number, inside);
        this->walk(*placed.scene, placed.number, inside);
        return false;
    }
    bool enter_mesh(const MeshTreeD& mesh, std::uint32_t number, const LineD& line) {
        const RayD ray = line.ray(this->tmin_, this->reach_);
        return is_valid(ray) && enter_mesh(mesh, number, ray);
    }
    HWY_INLINE bool enter_mesh(const MeshTreeD& mesh, std::uint32_t number, const RayD& ray) {
        const WideTreeD& tree = *mesh.tree;
        if (tree.empty() || (mesh.mask & this->mask_) == 0 || !at_.fill(tree, ray)) return false;
        mesh_ = &mesh, number_ = number;
        leaves_.emplace(tree, at_.line, at_.kind, at_.distances, at_.best);
        inner_.emplace(tree.view, at_.boxes, this->stack_, counts_, &*leaves_);
        now_ = &*inner_, in_mesh_ = true;
        return now_->begin(at_.boxes.tmax);
    }

    /// Nothing is left of the tree that the ray is in. Whether it goes on elsewhere.
    HWY_INLINE bool leave() {
        if (!in_mesh_) return false;
        if constexpr (any) {
            if (inner_->best().t < 0) this->best_.prim = 0;
        } else if (at_.best.found()) {
            this->keep(at_.hit(*mesh_, number_));
        }
        return go_on();
    }
    /// From a part, with what was found there.
    HWY_INLINE bool go_on() {
        if (!parts_ || (any && this->best_.hit())) return false;
        now_ = &*parts_, in_mesh_ = false;
        return parts_->skip(distances_.above(this->reach_ / t_scale_));
    }

    const SceneTreeD& scene_;
    const LineD line_;
    const WideStackView parts_stack_;
    One* now_ = nullptr;  // one of the two below
    bool in_mesh_ = false;
    std::optional<One> parts_, inner_;
    SingleFrame parts_frame_;
    BoxDistances distances_;  // of the parts
    double t_scale_ = 1;
    RayAtTriangles at_;
    std::optional<Leaves> leaves_;
    const MeshTreeD* mesh_ = nullptr;
    std::uint32_t number_ = 0;
    SimdCounts counts_;
};

/// The rays of a job.
template <bool any>
class SceneTurnsD {
public:
    explicit SceneTurnsD(SceneJobD& job) : job_(job) {}

    void trace() {
        std::array<Turn, rays_in_turn> turns;
        const std::size_t size = job_.tree->stack_size;
        job_.stack.reserve_words(size * rays_in_turn);
        const WideStackView stack = job_.stack.view();
        for (std::size_t k = 0; k < turns.size(); ++k) {
            turns[k].all = this;
            turns[k].stack = stack.from(k * size);
        }
        take_turns(turns);
    }

private:
    struct Turn {
        SceneTurnsD* all;
        WideStackView stack;
        std::optional<StandingRayD<any>> ray;
        std::size_t place;

        static constexpr bool has_parts = true;
        [[nodiscard]] TurnKind kind() const { return ray->kind(); }
        HWY_INLINE void ask() const { ray->ask(); }
        template <TurnKind kind>
        HWY_INLINE bool look(std::integral_constant<TurnKind, kind> what) {
            return ray->look(what);
        }
        HWY_INLINE void try_hit() { ray->try_hit(); }
        HWY_INLINE void keep_hit() { ray->keep_hit(); }
        template <TurnKind kind>
        HWY_INLINE bool step(std::integral_constant<TurnKind, kind> what) {
            if (ray->step(what)) return true;
            all->job_.set(place, ray->best());
            return false;
        }
        HWY_NOINLINE bool start() { return all->start(*this); }
    };

    bool start(Turn& turn) {
        while (next_ < job_.n) {
            turn.place = job_.place(next_++);
            if (job_.order != nullptr)
                hwy::Prefetch(job_.rays + job_.order[std::min(next_ + ahead, job_.n - 1)]);
            const RayD& ray = job_.rays[turn.place];
            HitD hit;
            if (is_valid(ray)) {
                turn.ray.emplace(*job_.tree, ray, job_.first + turn.place, job_.mask_of(turn.place),
                                 turn.stack);
                if (turn.ray->begin(ray)) return true;
                hit = turn.ray->best();
            } else {
                ++job_.invalid;
            }
            job_.set(turn.place, hit);
        }
        return false;
    }

    static constexpr std::size_t ahead = 16;
    SceneJobD& job_;
    std::size_t next_ = 0;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
