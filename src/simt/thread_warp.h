// The warp policy in which one thread is one lane: on a GPU, where the hardware lets threads part
// and meet, and on the CPU at width 1, where it is the scalar reference.
//
// Since Volta the threads of a warp part at any branch and need not meet behind it. So what lanes
// do together names its members, exactly the lanes that come to it:
// - all lanes of a warp are alive to the end: those without a ray are finished ones;
// - members are all lanes; within voting_loop those that are in it, within among those of its mask;
// - a member leaves those two only through meet(), where the members of before wait for each other;
// - there is no vote within loop and when, whose lanes nobody counts.
#pragma once

#include <bit>
#include <cstdint>

#include "base/atomic.h"
#include "base/device_words.h"
#include "base/hd.h"
#include "simt/op.h"

namespace raydix {

// RAYDIX_LANES_IN_STEP: the lanes of a warp go in step, as they did before Volta, so that nobody
// keeps account of members. Only to count instructions for machines of that time
// (scripts/sass_costs): such code would not run right on today's devices.
#if defined(RAYDIX_LANES_IN_STEP)
inline constexpr bool lanes_in_step = true;
using LaneMask = std::uint32_t;
#else
inline constexpr bool lanes_in_step = false;
/// A set of lanes: bit k is lane k.
using LaneMask = std::uint64_t;
#endif

/// What a warp does with memory. It waits for what it reads, unless another read beside is waited
/// for in any case.
enum class Access : std::uint8_t { read, read_beside, write };

/// The bits below `lane`.
template <class Mask>
RAYDIX_HD static inline Mask lanes_below(std::uint32_t lane) {
#if defined(RAYDIX_DEVICE_PASS)
    return (1u << lane) - 1;  // a device's masks have 32 bits; half the instructions
#else
    return (Mask{1} << lane) - 1;
#endif
}

/// What the hardware offers to the threads of a warp. `members`: the lanes that make this very
/// call.
struct WarpHardware {
    [[nodiscard]] RAYDIX_HD static constexpr std::uint32_t width() { return words::warp_width; }
    [[nodiscard]] RAYDIX_HD static std::uint32_t lane_id() { return words::lane_id(); }
    [[nodiscard]] RAYDIX_HD static LaneMask ballot(LaneMask members, bool vote) {
        return words::ballot(static_cast<std::uint32_t>(members), vote);
    }
    /// The value of lane `from`, a member.
    [[nodiscard]] RAYDIX_HD static std::uint32_t broadcast(LaneMask members, std::uint32_t value,
                                                           std::uint32_t from) {
        return words::shuffle(static_cast<std::uint32_t>(members), value, from);
    }
    /// Members wait for each other and see what each of them wrote before.
    RAYDIX_HD static void meet(LaneMask members) {
        words::meet(static_cast<std::uint32_t>(members));
    }
};

/// What a warp's lanes share; null where a kernel has no use for it.
template <class Lane>
struct WarpMemory {
    Lane* spares = nullptr;                // [width]: second rays, one a lane
    std::uint32_t* slots = nullptr;        // [width]: places of spare rays
    std::int32_t* packet_stack = nullptr;  // [max_depth + 1]: of packets, which have one for all
};

template <class Lane, class Hardware = WarpHardware>
class ThreadWarp {
public:
    Lane lane{};
    WarpMemory<Lane> memory{};
    Hardware hardware{};

    [[nodiscard]] RAYDIX_HD static constexpr std::uint32_t width() { return Hardware::width(); }
    [[nodiscard]] RAYDIX_HD std::uint32_t lane_id() const { return hardware.lane_id(); }

    template <class Cond, class Body>
    RAYDIX_HD void loop(Op, Cond cond, Body body) {
        while (cond(lane)) body();
    }
    template <class Cond, class Body>
    RAYDIX_HD void when(Cond cond, Body body) {
        if (cond(lane)) body();
    }
    template <class Fn>
    RAYDIX_HD void step(Op, Fn fn) {
        fn(lane);
    }
    /// A step, then `when` for two conditions, neither of which the other's body changes.
    template <class Fn, class First, class ThenFirst, class Second, class ThenSecond>
    RAYDIX_HD void step_then(Op op, Fn fn, First first, ThenFirst then_first, Second second,
                             ThenSecond then_second) {
        step(op, fn);
        when(first, then_first);
        when(second, then_second);
    }
    /// fn(lane, lane_id)
    template <class Fn>
    RAYDIX_HD void step_indexed(Op, Fn fn) {
        fn(lane, lane_id());
    }
    /// The lane is about to touch `bytes` at address(lane), or entry(lane) of its stack: of
    /// interest to memory models. Null and -1: it does not.
    template <class Address>
    RAYDIX_HD void touches(Access, Address, std::uint32_t) {}
    template <class Entry>
    RAYDIX_HD void touches_stack(Access, Entry) {}

    /// A loop whose members may vote. After each turn `stay`, the same for all members, may end it
    /// for all.
    template <class Cond, class Body, class Stay>
    RAYDIX_HD void voting_loop(Op, Cond cond, Body body, Stay stay) {
        if constexpr (lanes_in_step) {
            while (cond(lane)) {
                body();
                if (!stay()) break;
            }
            return;
        }
        const LaneMask entered = members_;
        while (true) {
            const bool in = cond(lane);
            const LaneMask left = hardware.ballot(members_, in);
            if (!in) break;
            members_ = left;
            body();
            if (!stay()) break;
        }
        members_ = entered;
        meet();
    }

    /// Members for whom cond(lane) holds.
    template <class Cond>
    [[nodiscard]] RAYDIX_HD LaneMask ballot(Op, Cond cond) {
        return hardware.ballot(members_, cond(lane));
    }
    /// The same with cond(lane, lane_id).
    template <class Cond>
    [[nodiscard]] RAYDIX_HD LaneMask ballot_indexed(Op, Cond cond) {
        return hardware.ballot(members_, cond(lane, lane_id()));
    }
    template <class Cond>
    [[nodiscard]] RAYDIX_HD bool any(Op op, Cond cond) {
        return ballot(op, cond) != 0;
    }
    /// Takes `count` from a pool's counter once for all members; all members get the first.
    [[nodiscard]] RAYDIX_HD std::uint32_t take(Op, std::uint32_t& counter, std::uint32_t count) {
        const std::uint32_t taker = first_member();
        const std::uint32_t first = lane_id() == taker ? claim(counter, count) : 0;
        return hardware.broadcast(members_, first, taker);
    }
    /// Computes a value that is the same in all lanes.
    template <class Fn>
    RAYDIX_HD auto uniform(Op, Fn fn) {
        return fn();
    }
    /// while (cond()) body(), where cond is the same in all lanes.
    template <class Cond, class Body>
    RAYDIX_HD void uniform_loop(Op, Cond cond, Body body) {
        while (cond()) body();
    }
    /// The members in `mask` run body; the others wait.
    template <class Body>
    RAYDIX_HD void among(LaneMask mask, Body body) {
        const LaneMask entered = members_;
        if ((mask >> lane_id() & 1) != 0) {
            if (!lanes_in_step) members_ = entered & mask;
            body();
        }
        members_ = entered;
        meet();
    }
    /// One lane writes to memory that the warp shares; all see it after.
    template <class Fn>
    RAYDIX_HD void write_shared(Op, Fn fn) {
        meet();  // nobody still reads the old value
        if (lane_id() == first_member()) fn();
        meet();
    }
    /// Members see what each of them wrote to shared memory.
    RAYDIX_HD void meet() const {
        if (!lanes_in_step) hardware.meet(members_);
    }

private:
    RAYDIX_HD std::uint32_t first_member() const {
#if defined(RAYDIX_DEVICE_PASS)
        return words::lowest_bit(static_cast<std::uint32_t>(members_));
#else
        return static_cast<std::uint32_t>(std::countr_zero(members_));
#endif
    }
    LaneMask members_ = ~LaneMask{0} >> (8 * sizeof(LaneMask) - width());
};

}  // namespace raydix
