// Rays through a wide tree that take turns, a node or leaf each: while one waits for memory the
// others go on. Included once per instruction set.
#if defined(RAYDIX_SIMD_TURNS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_TURNS_H
#undef RAYDIX_SIMD_TURNS_H
#else
#define RAYDIX_SIMD_TURNS_H
#endif

#include <hwy/highway.h>

#include <array>
#include <optional>
#include <type_traits>
#include <utility>

#include "trace/simd/single.h"
#include "trace/simd/single_frames.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// What a ray does in its next turn.
enum class TurnKind { node, leaf, part };

/// Rays that wait for their turn, each kind apart: jumps that depend on it could not be foreseen.
template <class Turn, std::size_t n>
class TurnLists {
public:
    HWY_INLINE void add(Turn* turn) {
        turn->ask();
        const TurnKind kind = turn->kind();
        // Every list takes the ray, and one of them keeps it.
        nodes_[at_nodes_] = turn;
        leaves_[at_leaves_] = turn;
        at_nodes_ += static_cast<std::size_t>(kind == TurnKind::node);
        at_leaves_ += static_cast<std::size_t>(kind == TurnKind::leaf);
        if constexpr (Turn::has_parts) {
            parts_[at_parts_] = turn;
            at_parts_ += static_cast<std::size_t>(kind == TurnKind::part);
        }
    }
    [[nodiscard]] bool empty() const { return at_nodes_ + at_leaves_ + at_parts_ == 0; }
    HWY_INLINE void step_nodes() {
        step_all(nodes_, at_nodes_, std::integral_constant<TurnKind, TurnKind::node>());
    }
    HWY_INLINE void step_leaves() {
        step_all(leaves_, at_leaves_, std::integral_constant<TurnKind, TurnKind::leaf>());
    }
    HWY_INLINE void step_parts() {
        step_all(parts_, at_parts_, std::integral_constant<TurnKind, TurnKind::part>());
    }

private:
    using List = std::array<Turn*, n>;
    template <class Kind>
    HWY_INLINE void step_all(const List& list, std::size_t& at, Kind kind) {
        const std::size_t count = std::exchange(at, 0);
        // Both halves of all turns apart: a jump in the second one that was guessed wrong is found
        // out at once, since nothing has to be waited for.
        for (std::size_t k = 0; k < count; ++k) list[k]->look(kind);
        for (std::size_t k = 0; k < count; ++k) {
            Turn* const turn = list[k];
            if (turn->step(kind) || turn->start()) add(turn);
        }
    }

    List nodes_, leaves_, parts_;
    std::size_t at_nodes_ = 0, at_leaves_ = 0, at_parts_ = 0;
};

/// Rays that take turns. Turn has:
///   bool start()                  the next ray; whether there was one
///   TurnKind kind()               what is next
///   void look(constant of kind)   does the first half of it
///   bool step(constant of kind)   does the rest; whether the ray goes on
///   void ask()                    for the memory that it needs next
template <class Turn, std::size_t n>
HWY_INLINE void take_turns(std::array<Turn, n>& turns) {
    TurnLists<Turn, n> lists;
    for (Turn& turn : turns)
        if (turn.start()) lists.add(&turn);
    while (!lists.empty()) {
        lists.step_nodes();
        lists.step_leaves();
        if constexpr (Turn::has_parts) lists.step_parts();
    }
}

template <Wanted query, bool counting, bool compact>
class RayTurns {
    static constexpr bool any = wants_any(query), all = query == Wanted::all;

public:
    RayTurns(const SimdJob& job, SimdCounts& counts) : job_(job), counts_(counts) {
        const V4 middle = hn::Load(f4, job.tree.middle),
                 half = hn::Max(hn::Sub(hn::Load(f4, job.tree.hi), middle),
                                hn::Sub(middle, hn::Load(f4, job.tree.lo)));
        hn::Store(hn::Mul(half, hn::Set(f4, 1.0f + 0x1p-20f)), f4, half_);  // and its rounding
    }

    void trace() {
        std::array<Turn, rays_in_turn> turns;
        for (std::size_t k = 0; k < turns.size(); ++k) {
            turns[k].rays = this;
            turns[k].stack = {job_.stack.words + k * job_.stack_size,
                              job_.stack.entries + k * job_.stack_size};
        }
        const std::size_t before = all ? job_.all->size() : 0;
        take_turns(turns);
        if constexpr (all) counts_.hits += group_by_ray(*job_.all, before, job_.n, job_.hit_counts);
    }

private:
    using One = SingleRay<query, counting, compact>;
    struct Turn {
        RayTurns* rays;
        WideStackView stack;
        SingleFrame frame;
        std::optional<One> ray;
        std::size_t i;  // of the ray in the job

        static constexpr bool has_parts = false;
        [[nodiscard]] TurnKind kind() const { return static_cast<TurnKind>(ray->next() >> 31); }
        HWY_INLINE void ask() const { ray->ask_for_next(); }
        template <TurnKind kind>
        HWY_INLINE void look(std::integral_constant<TurnKind, kind>) {
            kind == TurnKind::node ? ray->look_at_node() : ray->look_at_leaf();
        }
        template <TurnKind kind>
        HWY_INLINE bool step(std::integral_constant<TurnKind, kind>) {
            const bool on = kind == TurnKind::node ? ray->step_node() : ray->step_leaf();
            return on || rays->finish(*this);
        }
        HWY_NOINLINE bool start() { return rays->start(*this); }
    };

    HWY_INLINE bool start(Turn& turn) {
        while (next_ < job_.n) {
            const std::size_t k = next_ % lanes16;
            if (k == 0) read_ahead();
            ++next_;
            turn.i = static_cast<std::size_t>(index_[k]);
            if (frames_.take(k, turn.frame) ||
                fill_frame(job_.tree, job_.rays[turn.i], turn.frame)) {
                turn.ray.emplace(job_.tree, turn.frame, turn.stack, counts_, nullptr,
                                 static_cast<std::uint32_t>(turn.i));
                if constexpr (all) turn.ray->collect(*job_.all);
                if constexpr (wants_accepted(query))
                    turn.ray->check_by(*job_.check, job_.rays + turn.i);
                if ((!job_.passing || meets_bounds(turn.frame)) && turn.ray->begin(turn.frame.tmax))
                    return true;
            } else {
                ++counts_.invalid;
            }
            set(turn.i, {});
        }
        return false;
    }
    /// The next lanes16 rays, the last one again to fill the vector.
    HWY_INLINE void read_ahead() {
        for (std::size_t l = 0; l < lanes16; ++l) {
            const std::size_t k = std::min(next_ + l, job_.n - 1);
            index_[l] = static_cast<std::int32_t>(job_.order != nullptr ? job_.order[k] : k);
        }
        if (job_.order != nullptr)
            for (std::size_t l = 0; l < lanes16; ++l)
                ask_for_ray(job_.order[std::min(next_ + l + lanes16, job_.n - 1)]);
        frames_.fill(job_.rays, index_);
    }
    /// False only for rays that pass the root's bounds by, widened as boxes of nodes are.
    HWY_INLINE bool meets_bounds(const SingleFrame& frame) const {
        if (frame.careful) return true;
        const V4 reach = hn::Mul(hn::Abs(hn::Load(f4, frame.inverse)), hn::Load(f4, half_));
        alignas(16) float in[4], out[4];
        hn::Store(hn::Sub(hn::Load(f4, frame.near), reach), f4, in);
        hn::Store(hn::Add(hn::Load(f4, frame.far), reach), f4, out);
        return max_of(max_of(in[0], in[1]), max_of(in[2], frame.tmin)) <=
               min_of(min_of(out[0], out[1]), min_of(out[2], frame.tmax));
    }
    /// In an order of their own rays and hits lie anywhere.
    HWY_INLINE void ask_for_ray(std::size_t i) const {
        hwy::Prefetch(job_.rays + i);
        if constexpr (any)
            hwy::Prefetch(job_.occluded + i);
        else
            hwy::Prefetch(job_.hits.at(i));
    }

    /// False.
    HWY_INLINE bool finish(Turn& turn) {
        if constexpr (all) return false;
        const WideBest& best = turn.ray->best();
        TreeHit hit;
        if (best.found()) {
            ++counts_.hits;
            hit = {best.t * turn.frame.t_scale, best.prim, best.u, best.v};
        }
        set(turn.i, hit);
        return false;
    }
    HWY_INLINE void set(std::size_t i, const TreeHit& hit) {
        if constexpr (all) return;
        if constexpr (any)
            job_.occluded[i] = hit.hit() ? 1 : 0;
        else
            *job_.hits.at(i) = hit;
    }

    const SimdJob& job_;
    SimdCounts& counts_;
    std::size_t next_ = 0;
    HWY_ALIGN std::int32_t index_[lanes16];  // of the rays in frames_
    SingleFrames frames_{job_.tree};
    alignas(16) float half_[4];  // of the root's sides
};

inline void single(const SimdJob& job, SimdCounts& counts) {
    with_constants(job, [&](auto counting, auto compact) {
        if (job.all != nullptr)
            RayTurns<Wanted::all, counting, compact>(job, counts).trace();
        else if (job.check != nullptr)
            job.hits ? RayTurns<Wanted::closest_accepted, counting, compact>(job, counts).trace()
                     : RayTurns<Wanted::any_accepted, counting, compact>(job, counts).trace();
        else if (job.hits)
            RayTurns<Wanted::closest, counting, compact>(job, counts).trace();
        else
            RayTurns<Wanted::any, counting, compact>(job, counts).trace();
    });
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
