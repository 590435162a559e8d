// The warp policy in which one thread is one lane: on a GPU, where the hardware lets threads part
// and meet, and on the CPU at width 1, where it is the scalar reference.
//
// All lanes of a warp are alive to the end: those without a ray are finished ones. Votes count the
// members alone: all lanes, or within voting_loop those that are in it.
#pragma once

#include <cstdint>

#include "base/atomic.h"
#include "base/bits.h"
#include "base/hd.h"
#include "simt/op.h"

namespace raydix {

/// A set of lanes: bit k is lane k.
using LaneMask = std::uint64_t;

#if defined(__CUDACC__)
inline constexpr int device_warp_width = 32;
#endif

/// A node and the lanes that met its box: what packets put on their stack.
struct PacketEntry {
    std::int32_t node;
    LaneMask lanes;
};

/// What a warp's lanes share; null where a kernel has no use for it.
template <class Lane>
struct WarpMemory {
    Lane* spares = nullptr;          // [width]: second rays, one a lane
    std::uint32_t* slots = nullptr;  // [width]: places of spare rays
    PacketEntry* packets = nullptr;  // [max_depth + 1]
};

template <class Lane>
class ThreadWarp {
public:
    Lane lane{};
    WarpMemory<Lane> memory{};

    [[nodiscard]] RAYDIX_HD static constexpr std::uint32_t width() {
#if defined(__CUDACC__)
        return device_warp_width;
#else
        return 1;
#endif
    }
    [[nodiscard]] RAYDIX_HD static std::uint32_t lane_id() {
#if defined(__CUDA_ARCH__)
        return threadIdx.x % device_warp_width;
#else
        return 0;
#endif
    }

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
    /// fn(lane, lane_id)
    template <class Fn>
    RAYDIX_HD void step_indexed(Op, Fn fn) {
        fn(lane, lane_id());
    }
    /// The lane is about to read `bytes` at address(lane): of interest to memory models.
    template <class Address>
    RAYDIX_HD void reads(Address, std::uint32_t) {}

    /// A loop whose members may vote. After each turn `stay`, the same for all members, may end it
    /// for all.
    template <class Cond, class Body, class Stay>
    RAYDIX_HD void voting_loop(Op, Cond cond, Body body, Stay stay) {
        const LaneMask entered = members_;
        while (true) {
            const bool in = cond(lane);
            const LaneMask left = ballot_of(members_, in);
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
        return ballot_of(members_, cond(lane));
    }
    /// The same with cond(lane, lane_id).
    template <class Cond>
    [[nodiscard]] RAYDIX_HD LaneMask ballot_indexed(Op, Cond cond) {
        return ballot_of(members_, cond(lane, lane_id()));
    }
    template <class Cond>
    [[nodiscard]] RAYDIX_HD bool any(Op op, Cond cond) {
        return ballot(op, cond) != 0;
    }
    /// Takes `count` from a pool's counter for the whole warp; all lanes get the first.
    [[nodiscard]] RAYDIX_HD std::uint32_t take(Op, std::uint32_t& counter, std::uint32_t count) {
#if defined(__CUDA_ARCH__)
        std::uint32_t first = 0;
        if (lane_id() == 0) first = claim(counter, count);
        return __shfl_sync(0xFFFFFFFFu, first, 0);
#else
        return claim(counter, count);
#endif
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
    /// The lanes of `mask` run body; the others wait.
    template <class Body>
    RAYDIX_HD void among(LaneMask mask, Body body) {
        const LaneMask entered = members_;
        if ((mask >> lane_id() & 1) != 0) {
            members_ = mask;
            body();
        }
        members_ = entered;
        meet();
    }
    /// One lane writes to memory that the warp shares; all see it after.
    template <class Fn>
    RAYDIX_HD void write_shared(Op, Fn fn) {
        meet();  // nobody still reads the old value
        if (lane_id() == 0) fn();
        meet();
    }
    /// Members see what each of them wrote to shared memory.
    RAYDIX_HD void meet() const {
#if defined(__CUDA_ARCH__)
        __syncwarp(static_cast<unsigned>(members_));
#endif
    }

private:
    RAYDIX_HD static LaneMask ballot_of([[maybe_unused]] LaneMask members, bool vote) {
#if defined(__CUDA_ARCH__)
        return __ballot_sync(static_cast<unsigned>(members), vote);
#else
        return vote ? 1 : 0;
#endif
    }
    LaneMask members_ = width() == 1 ? 1 : 0xFFFFFFFFu;
};

}  // namespace raydix
