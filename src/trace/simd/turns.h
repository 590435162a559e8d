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
#include <bit>
#include <optional>
#include <type_traits>

#include "trace/simd/single_calls.h"
#include "trace/simd/single_frames.h"
#include "trace/simd/turn_ray.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Rays that wait for their turn, each kind apart: jumps that depend on it could not be foreseen.
/// All in one register.
class TurnSets {
public:
    static constexpr unsigned room = 21;  // rays of a kind

    [[nodiscard]] bool empty() const { return bits_ == 0; }
    HWY_INLINE void add(TurnKind kind, unsigned k) {
        bits_ |= std::uint64_t{1} << (static_cast<unsigned>(kind) * room + k);
    }
    /// Bit k: ray k was there, and is not any more.
    HWY_INLINE std::uint64_t take(TurnKind kind) {
        const unsigned from = static_cast<unsigned>(kind) * room;
        const std::uint64_t all = ((std::uint64_t{1} << room) - 1) << from, taken = bits_ & all;
        bits_ &= ~all;
        return taken >> from;
    }

private:
    std::uint64_t bits_ = 0;
};

/// Visits what the rays of the set `going` stand at, some at a time. First the first halves of
/// their visits, then the second ones: a jump that was guessed wrong is found out at once there,
/// since all it depends on has been there for a while. Some, not all: memory is asked for in second
/// halves, and a processor waits for so many lines at once only.
template <class Turn, class Kind>
HWY_INLINE void step_all(Turn* turns, std::uint64_t going, Kind kind, TurnSets& next) {
    constexpr unsigned at_once = 8;
    while (going != 0) {
        std::array<Turn*, at_once> here;
        unsigned count = 0;
        std::uint64_t hits = 0;
        for (; going != 0 && count < at_once; going &= going - 1, ++count) {
            here[count] = turns + std::countr_zero(going);
            hits |= std::uint64_t{here[count]->look(kind)} << count;
        }
        for (std::uint64_t left = hits; left != 0; left &= left - 1)
            here[static_cast<std::size_t>(std::countr_zero(left))]->try_hit();
        for (std::uint64_t left = hits; left != 0; left &= left - 1)
            here[static_cast<std::size_t>(std::countr_zero(left))]->keep_hit();
        for (unsigned k = 0; k < count; ++k) {
            Turn& turn = *here[k];
            if (!turn.step(kind) && !turn.start()) continue;
            turn.ask();
            next.add(turn.kind(), static_cast<unsigned>(&turn - turns));
        }
    }
}

/// Rays that take turns. Turn has:
///   bool start()                  the next ray; whether there was one
///   TurnKind kind()               what is next
///   bool look(constant of kind)   does the first half of it; whether there is a hit to look at
///   void try_hit(), keep_hit()    do so
///   bool step(constant of kind)   does the rest; whether the ray goes on
///   void ask()                    for the memory that it needs next
template <class Turn, std::size_t n>
HWY_INLINE void take_turns(std::array<Turn, n>& turns) {
    static_assert(n <= TurnSets::room);
    TurnSets sets;
    for (unsigned k = 0; k < n; ++k) {
        if (!turns[k].start()) continue;
        turns[k].ask();
        sets.add(turns[k].kind(), k);
    }
    const auto step = [&](auto kind) { step_all(turns.data(), sets.take(kind), kind, sets); };
    while (!sets.empty()) {
        step(std::integral_constant<TurnKind, TurnKind::node>());
        step(std::integral_constant<TurnKind, TurnKind::leaf>());
        if constexpr (Turn::has_parts) step(std::integral_constant<TurnKind, TurnKind::part>());
    }
}

/// The rays of a job, one after the other, their frames made lanes16 at a time.
class RaysOfJob {
public:
    RaysOfJob(const SimdJob& job, SimdCounts& counts) : job_(job), counts_(counts) {}

    /// The next ray that has something to do, its place in the job and its frame; false if none is
    /// left. Rays before it are invalid or pass the tree's bounds by: they miss.
    HWY_NOINLINE bool take(std::size_t& i, SingleFrame& frame) {
        while (at_ < count_ || read_ahead()) {
            const std::size_t k = at_++;
            i = static_cast<std::size_t>(index_[k]);
            if (frames_.take(k, frame) || fill_frame(job_.tree, job_.rays[i], frame)) return true;
            ++counts_.invalid;
            set(i, {});
        }
        return false;
    }
    /// Nothing where all hits are wanted: a ray that has none leaves none.
    HWY_INLINE void set(std::size_t i, const TreeHit& hit) const {
        if (job_.all != nullptr) return;
        if (job_.hits)
            job_.hits.put(i, hit);
        else
            job_.occluded[i] = hit.hit() ? 1 : 0;
    }

private:
    /// Frames of the next lanes16 rays, or of all that are left; false if there are none.
    HWY_INLINE bool read_ahead() {
        waiting_ -= count_;
        std::copy_n(index_ + count_, waiting_, index_);
        while (waiting_ < lanes16 && next_ < job_.n) take_up();
        at_ = 0;
        count_ = std::min(waiting_, lanes16);
        if (count_ == 0) return false;
        for (std::size_t l = count_; l < lanes16; ++l) index_[l] = index_[count_ - 1];
        frames_.fill(job_.rays, index_);
        return true;
    }
    /// The next lanes16 rays of the job, without those that pass the bounds by where many do.
    HWY_INLINE void take_up() {
        std::int32_t* const taken = index_ + waiting_;
        const std::size_t count = std::min(job_.n - next_, lanes16);
        for (std::size_t l = 0; l < lanes16; ++l) {  // the last one again to fill the vector
            const std::size_t k = std::min(next_ + l, job_.n - 1);
            taken[l] = static_cast<std::int32_t>(job_.order != nullptr ? job_.order[k] : k);
        }
        if (job_.order != nullptr)
            for (std::size_t l = 0; l < lanes16; ++l)
                ask_for_ray(job_.order[std::min(next_ + l + lanes16, job_.n - 1)]);
        next_ += count;
        if (!job_.passing) {
            waiting_ += count;
            return;
        }
        const std::uint32_t passing = frames_.passing_by(job_.rays, taken);
        for (std::size_t l = 0; l < count; ++l) {
            const std::int32_t i = taken[l];
            if ((passing >> l & 1) != 0)
                set(static_cast<std::size_t>(i), {});
            else
                index_[waiting_++] = i;
        }
    }
    /// In an order of their own rays and hits lie anywhere.
    HWY_INLINE void ask_for_ray(std::size_t i) const {
        hwy::Prefetch(job_.rays + i);
        if (job_.hits)
            hwy::Prefetch(job_.hits.at(i));
        else
            hwy::Prefetch(job_.occluded + i);
    }

    const SimdJob& job_;
    SimdCounts& counts_;
    std::size_t next_ = 0;                          // of the job that has not been taken up
    std::size_t waiting_ = 0, count_ = 0, at_ = 0;  // of index_: all, in frames_, and begun
    HWY_ALIGN std::int32_t index_[2 * lanes16];     // of rays in the job
    SingleFrames frames_{job_.tree};
};

template <Wanted query, bool counting, bool compact>
class RayTurns {
    static constexpr bool all = query == Wanted::all;

public:
    RayTurns(const SimdJob& job, SimdCounts& counts)
        : job_(job), counts_(counts), rays_(job, counts) {}

    void trace() {
        std::array<Turn, rays_in_turn> turns{};
        for (std::size_t k = 0; k < turns.size(); ++k) {
            turns[k].rays = this;
            turns[k].ray.emplace(job_.tree, turns[k].frame, job_.stack.from(k * job_.stack_size),
                                 counts_);
            if constexpr (all) turns[k].ray->collect(*job_.all);
        }
        const std::size_t before = all ? job_.all->size() : 0;
        take_turns(turns);
        if constexpr (all) counts_.hits += group_by_ray(*job_.all, before, job_.n, job_.hit_counts);
    }

private:
    using One = TurnRay<query, counting, compact>;
    struct Turn {
        RayTurns* rays;
        SingleFrame frame;
        std::optional<One> ray;
        std::size_t i;  // of the ray in the job

        static constexpr bool has_parts = false;
        [[nodiscard]] TurnKind kind() const { return static_cast<TurnKind>(ray->next() >> 31); }
        HWY_INLINE void ask() const { ray->ask_for_next(); }
        template <TurnKind kind>
        HWY_INLINE bool look(std::integral_constant<TurnKind, kind> what) {
            return ray->look(what);
        }
        HWY_INLINE void try_hit() { ray->try_hit(); }
        HWY_INLINE void keep_hit() { ray->keep_hit(); }
        template <TurnKind kind>
        HWY_INLINE bool step(std::integral_constant<TurnKind, kind>) {
            const bool on = kind == TurnKind::node ? ray->step_node() : ray->step_leaf();
            return on || rays->finish(*this);
        }
        HWY_NOINLINE bool start() { return rays->start(*this); }
    };

    HWY_INLINE bool start(Turn& turn) {
        while (rays_.take(turn.i, turn.frame)) {
            turn.ray->stand_for(static_cast<std::uint32_t>(turn.i));
            if constexpr (wants_accepted(query))
                turn.ray->check_by(*job_.check, job_.rays + turn.i);
            if (turn.ray->begin(turn.frame.tmax)) return true;
            rays_.set(turn.i, {});
        }
        return false;
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
        if constexpr (wants_any(query))
            job_.occluded[turn.i] = hit.hit() ? 1 : 0;
        else
            job_.hits.put(turn.i, hit);
        return false;
    }

    const SimdJob& job_;
    SimdCounts& counts_;
    RaysOfJob rays_;
};

inline void single(const SimdJob& job, SimdCounts& counts) {
    with_constants(job, [&](auto counting, auto compact) {
        if constexpr (counting) {
            if (job.all != nullptr)
                return RayTurns<Wanted::all, true, compact>(job, counts).trace();
            if (job.check != nullptr)
                return job.hits
                           ? RayTurns<Wanted::closest_accepted, true, compact>(job, counts).trace()
                           : RayTurns<Wanted::any_accepted, true, compact>(job, counts).trace();
        }
        job.hits ? RayTurns<Wanted::closest, counting, compact>(job, counts).trace()
                 : RayTurns<Wanted::any, counting, compact>(job, counts).trace();
    });
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
