// Rays through a scene that take turns: a node of the tree over parts or of a mesh's, a leaf of
// triangles, or the way into a part. Included once per instruction set.
#if defined(RAYDIX_ENGINE_SCENE_TURNS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_SCENE_TURNS_H
#undef RAYDIX_ENGINE_SCENE_TURNS_H
#else
#define RAYDIX_ENGINE_SCENE_TURNS_H
#endif

#include <hwy/highway.h>

#include <array>
#include <optional>
#include <type_traits>

#include "engine/scene_ray.h"
#include "trace/simd/turns.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// A ray that stands somewhere in a scene.
template <Wanted wanted>
class StandingRay : SceneRay<wanted> {
    using Walk = SceneRay<wanted>;
    using One = TurnRay<wanted, false, false>;
    static constexpr bool any = wants_any(wanted);

public:
    /// `scene` and `line` stay where they are; `stack` has room for SceneTree::stack_size.
    StandingRay(const SceneTree& scene, const SceneLine& line, const SceneJob::Limits& limits,
                std::size_t place, const WideStackView& stack)
        : Walk(limits, place, {}, stack, nullptr, false),
          scene_(scene),
          line_(line),
          parts_stack_(stack) {
        const auto room = [](const PartTree& tree) {
            return tree.empty() ? 0 : wide_stack_capacity(tree.arrays.stats.max_depth);
        };
        const std::size_t taken = std::max(room(scene.near), room(scene.wild));
        this->stack_ = stack.from(taken);
    }

    /// Whether there is anything to do.
    bool begin() {
        SceneLine room;
        if (const MeshTree* const mesh = scene_.only_mesh())
            return !mesh->tree->empty() && enter_mesh(*mesh, 0, line_at_mesh(line_, 0, room));
        if (const ShapeTree* const shapes = scene_.only_shapes())
            return !shapes->empty() && enter_shapes(*shapes, 0, line_);
        return begin_tree(scene_.near) || begin_tree(scene_.wild);
    }

    using Walk::filter_by;
    using Walk::store;

    [[nodiscard]] TurnKind kind() const {
        const std::uint32_t leaf = now_->next() >> 31;
        return static_cast<TurnKind>(leaf + (leaf & static_cast<std::uint32_t>(in_ != In::mesh)));
    }
    HWY_INLINE void ask() const {
        if (kind() == TurnKind::part)
            ask_for_part();
        else
            now_->ask_for_next();
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
        if (in_ == In::shapes) return test_shapes();
        return enter_part(part()) || go_on();
    }

private:
    /// What the tree that the ray is in holds.
    enum class In { parts, mesh, shapes };

    [[nodiscard]] std::uint32_t part() const {
        return tree_->part[(parts_->next() & ~wide_leaf_bit) >> 3];
    }
    HWY_INLINE void ask_for_part() const {
        if (in_ == In::shapes) {
            ask_for_shapes(*shapes_, now_->next());
            return;
        }
        const std::size_t own = scene_.own_part_count(), k = part();
        if (k >= own) ask_for_all(scene_.placed[k - own]);
    }

    bool begin_tree(const PartTree& tree) {
        tree_ = &tree;
        if (tree.empty() || !this->fill(tree.view, line_, tree.growth, parts_frame_)) return false;
        parts_.emplace(tree.view, parts_frame_, parts_stack_, counts_);
        now_ = &*parts_, in_ = In::parts;
        return now_->begin(parts_frame_.tmax);
    }

    /// What the ray visits in turns, if it is a mesh or shapes; all else at once. Whether it stands
    /// in one of those.
    HWY_NOINLINE bool enter_part(std::uint32_t part) {
        const std::size_t meshes = scene_.meshes.size();
        SceneLine inside;
        if (part < meshes)
            return enter_mesh(*scene_.meshes[part], 0, line_at_mesh(line_, 0, inside));
        const std::size_t own = scene_.own_part_count();
        if (part < own) return enter_shapes(*scene_.shapes[part - meshes], 0, line_);
        const PlacedScene& placed = scene_.placed[part - own];
        if (!sees(this->mask_, scene_, placed)) return false;
        enter(line_, scene_, placed, inside);
        if (placed.mesh != nullptr) return enter_mesh(*placed.mesh, placed.number, inside);
        this->walk(*placed.scene, placed.number, inside);
        return false;
    }
    HWY_INLINE bool enter_mesh(const MeshTree& mesh, std::uint32_t number, const SceneLine& line) {
        if (mesh.view.is_compact) {
            this->hit_mesh(mesh, number, line);
            return false;
        }
        if ((mesh.mask & this->mask_) == 0 || !this->fill(mesh.view, line, {}, inner_frame_))
            return false;
        mesh_ = &mesh, number_ = number, scale_ = line.scale;
        inner_.emplace(mesh.view, inner_frame_, this->stack_, counts_);
        if constexpr (wants_accepted(wanted)) inner_->check_by(check_, nullptr);
        now_ = &*inner_, in_ = In::mesh;
        return now_->begin(inner_frame_.tmax);
    }
    HWY_NOINLINE bool enter_shapes(const ShapeTree& shapes, std::uint32_t number,
                                   const SceneLine& line) {
        if ((shapes.mask & this->mask_) == 0 ||
            !this->fill(shapes.view, line, shapes.growth, inner_frame_))
            return false;
        shapes_ = &shapes, number_ = number;
        at_ = this->shape_ray(line, inner_frame_);
        inner_.emplace(shapes.view, inner_frame_, this->stack_, counts_);
        now_ = &*inner_, in_ = In::shapes;
        return now_->begin(inner_frame_.tmax);
    }
    HWY_INLINE bool test_shapes() {
        const std::uint32_t leaf = inner_->next() & ~wide_leaf_bit;
        this->hit_primitives(*shapes_, leaf >> 3, (leaf & 7) + 1, number_, at_);
        if (any && this->reach_ < 0) return false;
        return inner_->skip(min_of(at_.ray.tmax, std::numeric_limits<float>::max())) || go_on();
    }

    /// Asks the filter about a hit of the mesh that the ray is in.
    static bool accepts_hit(const void* context, const Ray*, const TreeHit& hit) {
        const auto& ray = *static_cast<const StandingRay*>(context);
        return ray.accepts(hit_in_scene(*ray.mesh_, ray.number_, ray.scale_, hit));
    }

    /// Nothing is left of the tree that the ray is in. Whether it goes on elsewhere.
    HWY_NOINLINE bool leave() {
        if (in_ == In::parts) return tree_ == &scene_.near && begin_tree(scene_.wild);
        if (in_ == In::shapes) return go_on();
        if (const WideBest& best = inner_->best(); best.found())
            keep<any>(*mesh_, number_, scale_, {best.t, best.prim, best.u, best.v}, this->best_,
                      this->reach_);
        return go_on();
    }
    /// From a part, with what was found there.
    HWY_INLINE bool go_on() {
        if (tree_ == nullptr || (any && this->reach_ < 0)) return false;
        now_ = &*parts_, in_ = In::parts;
        const float reach = line_.end(this->reach_);
        if (parts_->skip(min_of(reach, std::numeric_limits<float>::max()))) return true;
        return tree_ == &scene_.near && begin_tree(scene_.wild);
    }

    const SceneTree& scene_;
    const SceneLine& line_;
    const WideStackView parts_stack_;
    One* now_ = nullptr;  // one of the two below
    In in_ = In::parts;
    const PartTree* tree_ = nullptr;  // null: the scene is one mesh, or one geometry of shapes
    SingleFrame parts_frame_, inner_frame_;
    std::optional<One> parts_, inner_;
    const MeshTree* mesh_ = nullptr;
    const ShapeTree* shapes_ = nullptr;
    ShapeRay at_;
    const HitCheck check_{&accepts_hit, this};
    std::uint32_t number_ = 0;
    double scale_ = 1;
    SimdCounts counts_;
};

/// Rays of a job, into its hits and limits.
template <Wanted wanted, class Start>
class SceneTurns {
public:
    /// start(k): ray k of the job, with its limits; null if it can see nothing.
    SceneTurns(SceneJob& job, const Start& start) : job_(job), start_(start) {}

    void trace() {
        std::array<Turn, rays_in_turn> turns;
        for (std::size_t k = 0; k < turns.size(); ++k) {
            turns[k].all = this;
            turns[k].stack = job_.single_stack.view().from(k * job_.tree->stack_size);
        }
        take_turns(turns);
    }

private:
    struct Turn {
        SceneTurns* all;
        WideStackView stack;
        SceneLine line;
        std::optional<StandingRay<wanted>> ray;
        std::uint32_t id;

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
            ray->store(all->job_, id);
            return false;
        }
        HWY_NOINLINE bool start() { return all->start(*this); }
    };

    bool start(Turn& turn) {
        while (next_ < job_.n) {
            turn.id = static_cast<std::uint32_t>(next_++);
            const Ray* const ray = start_(turn.id);
            if (ray == nullptr) continue;
            turn.line = HWY_NAMESPACE::line_of(*ray);
            turn.ray.emplace(*job_.tree, turn.line, job_.limits[turn.id], job_.place(turn.id),
                             turn.stack);
            if constexpr (wants_accepted(wanted)) turn.ray->filter_by(*job_.filter, *ray);
            if (turn.ray->begin()) return true;
            turn.ray->store(job_, turn.id);
        }
        return false;
    }

    SceneJob& job_;
    const Start start_;
    std::size_t next_ = 0;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
