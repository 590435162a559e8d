// When warps run on a machine of several multiprocessors: each shares its issue slots evenly among
// its warps, and none may issue faster than the latency of its own instructions allows.
#pragma once

#include <cstdint>
#include <functional>
#include <queue>
#include <vector>

namespace raydix {

/// Rates of one multiprocessor, in warp instructions per clock.
struct IssueRates {
    double shared;    // all warps together
    double one_warp;  // a warp alone
};

/// Warps with work, in order of the time at which they finish it. Time in clocks.
class Multiprocessors {
public:
    Multiprocessors(std::uint32_t count, IssueRates rates) : rates_(rates), parts_(count) {}

    /// Gives warp `warp` of multiprocessor `place` so many instructions, from now on.
    void add(std::uint32_t place, std::uint32_t warp, std::uint64_t instructions) {
        Part& part = parts_[place];
        advance(part);
        part.running.push({part.served + static_cast<double>(instructions), warp});
        announce(place);
    }
    [[nodiscard]] bool idle() const { return active_ == 0; }
    [[nodiscard]] double now() const { return now_; }

    /// Instructions given and not yet issued.
    [[nodiscard]] double work_left() {
        double left = 0;
        for (Part& part : parts_) {
            advance(part);
            for (const Job& job : part.running.jobs()) left += job.due - part.served;
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
            --active_;
            part.served = job.due;  // no rounding left behind
            announce(event.place, false);
            return {event.place, job.warp};
        }
    }

private:
    struct Job {
        double due;  // service at which it is done
        std::uint32_t warp;
        bool operator>(const Job& o) const { return due != o.due ? due > o.due : warp > o.warp; }
    };
    struct Queue : std::priority_queue<Job, std::vector<Job>, std::greater<>> {
        [[nodiscard]] const std::vector<Job>& jobs() const { return c; }
    };
    struct Part {
        double served = 0;  // instructions that each of its warps has had since the start
        double since = 0;   // time of `served`
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

    [[nodiscard]] double rate(const Part& part) const {
        const double fair = rates_.shared / static_cast<double>(part.running.size());
        return fair < rates_.one_warp ? fair : rates_.one_warp;
    }
    void advance(Part& part) {
        if (!part.running.empty()) part.served += (now_ - part.since) * rate(part);
        part.since = now_;
    }
    void announce(std::uint32_t place, bool added = true) {
        Part& part = parts_[place];
        if (added) ++active_;
        ++part.version;
        if (part.running.empty()) return;
        const double left = part.running.top().due - part.served;
        events_.push({now_ + (left > 0 ? left / rate(part) : 0.0), place, part.version});
    }

    IssueRates rates_;
    std::vector<Part> parts_;
    std::priority_queue<Event, std::vector<Event>, std::greater<>> events_;
    double now_ = 0;
    std::size_t active_ = 0;
};

}  // namespace raydix
