// Calls of lanes that wait for each other.
#include "support/thread_lanes.h"

#include <fmt/format.h>

#include <bit>
#include <thread>

namespace raydix::test {

using Clock = std::chrono::steady_clock;

LaneBoard::LaneBoard(std::chrono::milliseconds patience) : patience_(patience) {
    for (Log& log : logs_) log.entries.resize(capacity);
}

void LaneBoard::fail(const std::string& fault) {
    const std::lock_guard lock(mutex_);
    if (fault_.empty()) fault_ = fault;
    broken_.store(true, std::memory_order_relaxed);
    throw BrokenWarp(fault);
}

std::string LaneBoard::told(const Entry& entry) {
    const char* names[] = {"ballot", "broadcast", "meet"};
    return fmt::format("{} of {:08X}", names[static_cast<std::size_t>(entry.call)], entry.members);
}

std::string LaneBoard::last_call(std::uint32_t lane) const {
    const Log& log = logs_[lane];
    const std::uint32_t length = log.length.load(std::memory_order_acquire);
    return length == 0 ? "nothing" : told(log.entries[length - 1]);
}

void LaneBoard::run(const std::function<void(std::uint32_t)>& body) {
    std::vector<std::thread> threads;
    for (std::uint32_t lane = 0; lane < thread_lanes; ++lane)
        threads.emplace_back([this, lane, &body] {
            try {
                body(lane);
            } catch (const BrokenWarp&) {  // kept by fail
            }
            logs_[lane].ended.store(true, std::memory_order_release);
        });
    for (std::thread& thread : threads) thread.join();
    if (broken_.load()) throw BrokenWarp(fault_);
}

std::uint32_t ThreadLane::value_of(std::uint32_t other, const LaneBoard::Entry& mine,
                                   State::Place& place) const {
    LaneBoard& board = *state->board;
    const LaneBoard::Log& log = board.logs_[other];
    std::uint64_t calls = 0;
    Clock::time_point since = Clock::now();
    for (std::uint32_t tries = 0;; ++tries) {
        const bool ended = log.ended.load(std::memory_order_acquire);  // before the length
        const std::uint32_t length = log.length.load(std::memory_order_acquire);
        for (std::uint32_t& at = place.read[other]; at < length; ++at) {
            const LaneBoard::Entry& entry = log.entries[at];
            if (entry.members != mine.members) continue;
            if (entry.turn != mine.turn) continue;
            if (entry.call != mine.call)
                board.fail(fmt::format("lane {} is in {}, lane {} in {}", state->lane,
                                       LaneBoard::told(mine), other, LaneBoard::told(entry)));
            ++at;
            return entry.value;
        }
        if (board.broken_.load(std::memory_order_relaxed)) throw BrokenWarp("another lane");
        if (ended)
            board.fail(fmt::format("lane {} is in {}, but lane {} has ended", state->lane,
                                   LaneBoard::told(mine), other));
        // 32 threads and more share a few cores: those that sleep leave them to the one waited for.
        std::this_thread::sleep_for(std::chrono::microseconds(tries < 64 ? 5 : 200));
        if (tries % 16 != 0) continue;
        const std::uint64_t now = board.calls_.load(std::memory_order_relaxed);
        if (now != calls) {
            calls = now;
            since = Clock::now();
        } else if (Clock::now() - since > board.patience_) {
            board.fail(fmt::format(
                "lane {} waits in {} for lane {}, whose last call was {}; no lane has come on for "
                "{} ms",
                state->lane, LaneBoard::told(mine), other, board.last_call(other),
                board.patience_.count()));
        }
    }
}

ThreadLane::Values ThreadLane::call_with(LaneBoard::Call call, LaneMask members,
                                         std::uint32_t value) const {
    LaneBoard& board = *state->board;
    const auto mask = static_cast<std::uint32_t>(members);
    State::Place& place = state->places[mask];
    const LaneBoard::Entry mine{call, mask, place.turns++, value};
    if (members >> 32 != 0 || (mask >> state->lane & 1) == 0)
        board.fail(
            fmt::format("lane {} is no member of its own {}", state->lane, LaneBoard::told(mine)));
    LaneBoard::Log& log = board.logs_[state->lane];
    const std::uint32_t length = log.length.load(std::memory_order_relaxed);
    if (length == LaneBoard::capacity) board.fail("a lane makes too many calls");
    log.entries[length] = mine;
    log.length.store(length + 1, std::memory_order_release);
    board.calls_.fetch_add(1, std::memory_order_relaxed);
    Values values{};
    for (std::uint32_t left = mask; left != 0; left &= left - 1) {
        const auto other = static_cast<std::uint32_t>(std::countr_zero(left));
        values[other] = other == state->lane ? value : value_of(other, mine, place);
    }
    return values;
}

LaneMask ThreadLane::ballot(LaneMask members, bool vote) const {
    const Values values = call_with(LaneBoard::Call::ballot, members, vote ? 1 : 0);
    LaneMask votes = 0;
    for (std::uint32_t lane = 0; lane < thread_lanes; ++lane)
        votes |= LaneMask{values[lane]} << lane;
    return votes;
}

std::uint32_t ThreadLane::broadcast(LaneMask members, std::uint32_t value,
                                    std::uint32_t from) const {
    if ((members >> from & 1) == 0)
        state->board->fail(fmt::format("lane {} asks lane {}, which is no member of {:08X}",
                                       state->lane, from, members));
    return call_with(LaneBoard::Call::broadcast, members, value)[from];
}

void ThreadLane::meet(LaneMask members) const {
    static_cast<void>(call_with(LaneBoard::Call::meet, members, 0));
}

}  // namespace raydix::test
