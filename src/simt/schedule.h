// When warps run on a machine of several multiprocessors: each shares its issue slots among its
// warps, and none runs faster than the latency of its own instructions and reads allows.
#pragma once

#include <raydix/simulate.h>

#include <cstdint>
#include <functional>
#include <queue>
#include <vector>

namespace raydix {

/// What a warp does next.
struct WarpWork {
    double instructions;
    double alone_clocks;  // that it would take on a multiprocessor of its own
};

/// Warps with work, in order of the time at which they finish it. Time in clocks.
///
/// As long as there are slots for all, a warp takes its own `alone_clocks`. Where its warps ask for
/// more slots than there are, a multiprocessor slows all of them down by the same factor.
class Multiprocessors {
public:
    /// `slots`: warp instructions per clock of one multiprocessor.
    Multiprocessors(std::uint32_t count, double slots) : slots_(slots), parts_(count) {}

    /// Gives warp `warp` of multiprocessor `place` work, from now on.
    void add(std::uint32_t place, std::uint32_t warp, WarpWork work) {
        Part& part = parts_[place];
        advance(part);
        const double rate = work.alone_clocks > 0 ? work.instructions / work.alone_clocks : 0.0;
        part.running.push({part.served + work.alone_clocks, rate, warp});
        part.asked += rate;
        ++active_;
        announce(place);
    }
    [[nodiscard]] bool idle() const { return active_ == 0; }
    [[nodiscard]] double now() const { return now_; }

    /// Instructions given and not yet issued.
    [[nodiscard]] double work_left() {
        double left = 0;
        for (Part& part : parts_) {
            advance(part);
            for (const Job& job : part.running.jobs()) left += (job.due - part.served) * job.rate;
        }
        return left;
    }

    struct Finished {
        std::uint32_t place, warp;
    };
    /// The next warp to finish; time goes on to then. Ties: lower place, then lower warp.
    Finished next() {
        while (true) {
            const Event event = events_.top();
            events_.pop();
            Part& part = parts_[event.place];
            if (event.version != part.version) continue;  // the multiprocessor's load has changed
            now_ = event.time;
            advance(part);
            const Job job = part.running.top();
            part.running.pop();
            part.asked = part.running.empty() ? 0.0 : part.asked - job.rate;
            part.served = job.due;  // no rounding left behind
            --active_;
            announce(event.place);
            return {event.place, job.warp};
        }
    }

private:
    struct Job {
        double due;   // service at which it is done
        double rate;  // instructions a clock while it runs at full speed
        std::uint32_t warp;
        bool operator>(const Job& o) const { return due != o.due ? due > o.due : warp > o.warp; }
    };
    struct Queue : std::priority_queue<Job, std::vector<Job>, std::greater<>> {
        [[nodiscard]] const std::vector<Job>& jobs() const { return c; }
    };
    struct Part {
        double served = 0;  // clocks of its own that each of its warps has had since the start
        double since = 0;   // time of `served`
        double asked = 0;   // slots a clock that its warps would use at full speed
        std::uint64_t version = 0;
        Queue running;
    };
    struct Event {
        double time;
        std::uint32_t place;
        std::uint64_t version;
        bool operator>(const Event& o) const {
            return time != o.time ? time > o.time : place > o.place;
        }
    };

    /// Own clocks that a warp gets in one clock.
    [[nodiscard]] double speed(const Part& part) const {
        return part.asked > slots_ ? slots_ / part.asked : 1.0;
    }
    void advance(Part& part) {
        if (!part.running.empty()) part.served += (now_ - part.since) * speed(part);
        part.since = now_;
    }
    void announce(std::uint32_t place) {
        Part& part = parts_[place];
        ++part.version;
        if (part.running.empty()) return;
        const double left = part.running.top().due - part.served;
        events_.push({now_ + (left > 0 ? left / speed(part) : 0.0), place, part.version});
    }

    double slots_;
    std::vector<Part> parts_;
    std::priority_queue<Event, std::vector<Event>, std::greater<>> events_;
    double now_ = 0;
    std::size_t active_ = 0;
};

/// Blocks of a launch on places that are taken and freed: which block goes where, and when.
///
/// Documentation of NVIDIA's machines says of Fermi that blocks run out of order, as something new
/// (Fermi white paper, GigaThread); before, a place is free when its block and all earlier ones are
/// done.
class BlockPlaces {
public:
    BlockPlaces(std::uint32_t multiprocessors, std::uint32_t places, std::size_t blocks,
                BlockRelease release)
        : release_(release), where_(blocks), done_(blocks) {
        for (std::uint32_t k = 0; k < places; ++k)
            for (std::uint32_t place = 0; place < multiprocessors; ++place) free_.push(place);
    }

    struct Start {
        std::size_t block;
        std::uint32_t place;
    };
    /// The next block, if there is one and a place for it.
    [[nodiscard]] bool take(Start& start) {
        if (next_ == where_.size() || free_.empty()) return false;
        start = {next_, free_.front()};
        free_.pop();
        where_[next_++] = start.place;
        return true;
    }
    [[nodiscard]] bool all_taken() const { return next_ == where_.size(); }

    void finish(std::size_t block) {
        done_[block] = true;
        if (release_ == BlockRelease::own) {
            free_.push(where_[block]);
            return;
        }
        while (retired_ < next_ && done_[retired_]) ++retired_;
        if (release_ == BlockRelease::together && retired_ < next_) return;
        for (; freed_ < retired_; ++freed_) free_.push(where_[freed_]);
    }

private:
    BlockRelease release_;
    std::queue<std::uint32_t> free_;
    std::vector<std::uint32_t> where_;
    std::vector<bool> done_;
    std::size_t next_ = 0, retired_ = 0, freed_ = 0;
};

}  // namespace raydix
