// The lanes of a warp as threads of the host: what WarpHardware is on a GPU, so that ThreadWarp
// runs as it does there, with lanes that part wherever they like and meet only where the code makes
// them. A call is answered when all of its members have made it, and every mistake that would hang
// or be undefined on a GPU is an exception in every lane.
//
// Lanes learn of each other through what they published alone, so the thread sanitizer sees exactly
// the order that the members of a call are promised, and no other.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <vector>

#include "simt/thread_warp.h"

namespace raydix::test {

inline constexpr std::uint32_t thread_lanes = 32;

struct BrokenWarp : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// What lanes publish. One per warp.
class LaneBoard {
public:
    enum class Call : std::uint32_t { ballot, broadcast, meet };

    /// `patience`: so long no lane may come on before those that wait give up.
    explicit LaneBoard(std::chrono::milliseconds patience);

    /// body(lane) on a thread for each lane. Throws BrokenWarp with the first fault.
    void run(const std::function<void(std::uint32_t lane)>& body);

private:
    friend class ThreadLane;
    /// A lane's calls in their order. `turn`: how often the lane called with these members before.
    struct Entry {
        Call call;
        std::uint32_t members, turn, value;
    };
    struct Log {
        std::vector<Entry> entries;
        std::atomic<std::uint32_t> length{0};
        std::atomic<bool> ended{false};
    };
    static constexpr std::size_t capacity = 1 << 15;

    [[noreturn]] void fail(const std::string& fault);
    [[nodiscard]] static std::string told(const Entry& entry);
    [[nodiscard]] std::string last_call(std::uint32_t lane) const;

    std::chrono::milliseconds patience_;
    std::array<Log, thread_lanes> logs_;
    std::atomic<std::uint64_t> calls_{0};
    std::atomic<bool> broken_{false};
    std::mutex mutex_;
    std::string fault_;
};

/// One lane's view: the Hardware of its ThreadWarp, which copies the pointer.
class ThreadLane {
public:
    struct State {
        LaneBoard* board;
        std::uint32_t lane;
        /// How far the logs of the others were read, by members; and how many calls there were.
        struct Place {
            std::uint32_t turns = 0;
            std::array<std::uint32_t, thread_lanes> read{};
        };
        std::map<std::uint32_t, Place> places;
    };
    State* state = nullptr;

    [[nodiscard]] static constexpr std::uint32_t width() { return thread_lanes; }
    [[nodiscard]] std::uint32_t lane_id() const { return state->lane; }
    [[nodiscard]] LaneMask ballot(LaneMask members, bool vote) const;
    [[nodiscard]] std::uint32_t broadcast(LaneMask members, std::uint32_t value,
                                          std::uint32_t from) const;
    void meet(LaneMask members) const;

private:
    using Values = std::array<std::uint32_t, thread_lanes>;
    [[nodiscard]] Values call_with(LaneBoard::Call call, LaneMask members,
                                   std::uint32_t value) const;
    [[nodiscard]] std::uint32_t value_of(std::uint32_t other, const LaneBoard::Entry& mine,
                                         State::Place& place) const;
};

}  // namespace raydix::test
