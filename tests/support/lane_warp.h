// A warp whose lanes are threads of their own, as those of a GPU are. Lanes wait for each other in
// ballots and shuffles, and what these say is all that a lane then knows of the others; only sync
// orders memory. So the thread sanitizer sees what leans on more than exec/warp.h promises.
#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstdint>
#include <thread>

#include "exec/crew.h"
#include "exec/host_launcher.h"
#include "exec/warp.h"

namespace raydix::test {

/// Where the 32 lanes of a warp leave their values. A value carries the turn that it belongs to, so
/// that relaxed accesses suffice; the two of a lane are used in turn, so that the next turn's value
/// does not come before all have seen the last one's.
class LaneBoard {
public:
    /// Leaves `value` and waits for those of all lanes. The orders are constants: GCC takes one
    /// that it does not know when it compiles for the strongest.
    template <bool orders_memory>
    std::array<std::uint32_t, warp_lanes> exchange(std::uint32_t lane, std::uint32_t turn,
                                                   std::uint32_t value) {
        constexpr auto leave =
            orders_memory ? std::memory_order_release : std::memory_order_relaxed;
        constexpr auto find = orders_memory ? std::memory_order_acquire : std::memory_order_relaxed;
        place(lane, turn).store(std::uint64_t{turn} << 32 | value, leave);
        std::array<std::uint32_t, warp_lanes> values;
        for (std::uint32_t other = 0; other < warp_lanes; ++other)
            values[other] = wait_for<find>(place(other, turn), turn);
        return values;
    }

private:
    struct alignas(64) Places {
        std::atomic<std::uint64_t> of_turn[2] = {};
    };
    std::atomic<std::uint64_t>& place(std::uint32_t lane, std::uint32_t turn) {
        return places_[lane].of_turn[turn % 2];
    }
    template <std::memory_order order>
    static std::uint32_t wait_for(const std::atomic<std::uint64_t>& place, std::uint32_t turn) {
        for (;;) {
            const std::uint64_t there = place.load(order);
            if (there >> 32 == turn) return static_cast<std::uint32_t>(there);
            std::this_thread::yield();
        }
    }
    Places places_[warp_lanes];
};

struct LaneIdentity {
    LaneBoard* board = nullptr;
    std::uint32_t lane = 0, turn = 0;
};

/// As DeviceWarp, an object has no state: which lane of which warp it is, its thread knows.
class LaneWarp {
public:
    template <class T>
    class Var {
    public:
        T& operator[](std::uint32_t) { return value_; }
        const T& operator[](std::uint32_t) const { return value_; }

    private:
        T value_{};
    };

    template <class Body>
    void each(const Body& body) const {
        body(self.lane);
    }
    template <class Vote>
    [[nodiscard]] std::uint32_t ballot(const Vote& vote) const {
        const auto votes = exchange(vote(self.lane) ? 1 : 0);
        std::uint32_t mask = 0;
        for (std::uint32_t lane = 0; lane < warp_lanes; ++lane) mask |= votes[lane] << lane;
        return mask;
    }
    template <class T, class Source>
    [[nodiscard]] Var<T> shuffle(const Var<T>& from, const Source& source) const {
        Var<T> to;
        to[0] = broadcast(from, source(self.lane) & 31);
        return to;
    }
    template <class T>
    [[nodiscard]] T broadcast(const Var<T>& from, std::uint32_t source) const {
        static_assert(sizeof(T) == 4 || sizeof(T) == 8);
        if constexpr (sizeof(T) == 4) {
            return std::bit_cast<T>(exchange(std::bit_cast<std::uint32_t>(from[0]))[source]);
        } else {
            const auto bits = std::bit_cast<std::uint64_t>(from[0]);
            const std::uint64_t low = exchange(static_cast<std::uint32_t>(bits))[source];
            const std::uint64_t high = exchange(static_cast<std::uint32_t>(bits >> 32))[source];
            return std::bit_cast<T>(high << 32 | low);
        }
    }
    /// A release and an acquire of every lane.
    void sync() const { static_cast<void>(self.board->exchange<true>(self.lane, ++self.turn, 0)); }

    static inline thread_local LaneIdentity self;

private:
    static std::array<std::uint32_t, warp_lanes> exchange(std::uint32_t value) {
        return self.board->exchange<false>(self.lane, ++self.turn, value);
    }
};

/// Launches of warps and tiles: two warps at a time, of 32 threads each; others by the host. What a
/// lane learns of the other warp the rest of its own does not know before a sync.
class LaneLauncher : public HostLauncher<> {
public:
    template <class Work>
    void launch_warps(const char* label, const std::uint32_t* count, std::uint32_t limit,
                      const Work& work) {
        launch_tiles(label, warps_for(std::min(*count, limit)), work);
    }
    template <class Work>
    void launch_tiles(const char*, std::uint32_t n, const Work& work) {
        constexpr std::uint32_t at_a_time = 2, threads = at_a_time * warp_lanes;
        LaneBoard boards[at_a_time];
        std::atomic<std::uint32_t> next_thread{0};
        crew_.run(threads - 1, [&] {
            const std::uint32_t thread = next_thread.fetch_add(1, std::memory_order_relaxed);
            // No warp ends before another begins: to begin orders memory.
            while (next_thread.load(std::memory_order_relaxed) < threads) std::this_thread::yield();
            const std::uint32_t first = thread / warp_lanes;
            LaneWarp::self = {&boards[first], thread % warp_lanes, 0};
            for (std::uint32_t w = first; w < n; w += at_a_time) work(LaneWarp(), w);
        });
    }

private:
    Crew crew_;
};

}  // namespace raydix::test
