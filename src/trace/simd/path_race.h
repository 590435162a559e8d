// The way that the jobs of one batch take: the one that takes the least time for a ray. It cannot
// be told from the rays: it depends on how many of them go the same way in the tree and how deep,
// so on the scene too.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <ctime>

#include "base/math.h"

namespace raydix {

class PathRace {
public:
    static constexpr std::size_t most = 3;

    /// Between ways 0 to `likely` - 1, any of which may win, and `others`, which rarely do and may
    /// take far longer. At least one, and at most `most`.
    PathRace(std::size_t likely, std::size_t others)
        : likely_(likely), count_(std::min(likely + others, most)) {}

    /// Rays begin to end - 1 of a job, by trace(way, begin, end). The likely ways get the first
    /// jobs by turns. After that the fastest way so far gets most of a job. The other ways get a
    /// few rays of each trial: what pays differs from place to place, and so they are compared all
    /// over the batch.
    template <class Trace>
    void run(std::size_t begin, std::size_t end, const Trace& trace) {
        const auto timed = [&](std::size_t way, std::size_t last) {
            const std::int64_t start = thread_ns();
            trace(way, begin, last);
            add(way, last - begin, thread_ns() - start);
            begin = last;
        };
        const std::uint32_t job = begun_.fetch_add(1, std::memory_order_relaxed);
        const std::size_t main = main_way(job);
        if (is_trial(job)) {
            const std::size_t share = std::min(largest_share, (end - begin) / (2 * count_));
            for (std::size_t way = likely_; way < count_ && share > 0; ++way)
                if (way != main) timed(way, begin + share);
        }
        if (begin != end) timed(main, end);
    }

    [[nodiscard]] bool is_trial(std::uint32_t job) const { return job < firsts() || job % 4 == 0; }
    /// The way of most rays of a job.
    [[nodiscard]] std::size_t main_way(std::uint32_t job) const {
        return job < firsts() ? job % likely_ : fastest();
    }
    /// The first one where nothing is known yet.
    [[nodiscard]] std::size_t fastest() const {
        std::size_t best = 0;
        double least = infinity;
        for (std::size_t k = 0; k < count_; ++k)
            if (const double ns = runners_[k].ns_a_ray(); ns < least) least = ns, best = k;
        return best;
    }
    /// What some rays took. The first ones of each way do not count.
    void add(std::size_t way, std::size_t rays, std::int64_t ns) {
        if (way < most) runners_[way].add(rays, ns);
    }

private:
    /// Enough to tell, and few where it is the wrong way by far.
    static constexpr std::size_t largest_share = 128;

    /// Two jobs for each likely way: one of them finds memory as it was.
    [[nodiscard]] std::uint32_t firsts() const { return 2 * static_cast<std::uint32_t>(likely_); }

    /// Processor time of this thread, so that other programs decide nothing.
    [[nodiscard]] static std::int64_t thread_ns() {
#if defined(CLOCK_THREAD_CPUTIME_ID)
        std::timespec now{};
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
        return std::int64_t{now.tv_sec} * 1000000000 + now.tv_nsec;
#else
        return 0;  // the first way then
#endif
    }

    struct Runner {
        std::atomic<bool> warm{false};
        std::atomic<std::int64_t> rays{0}, ns{0};

        void add(std::size_t more_rays, std::int64_t more_ns) {
            if (!warm.exchange(true, std::memory_order_relaxed)) return;
            rays.fetch_add(static_cast<std::int64_t>(more_rays), std::memory_order_relaxed);
            ns.fetch_add(more_ns, std::memory_order_relaxed);
        }
        /// Infinite before the second ones have ended.
        [[nodiscard]] double ns_a_ray() const {
            const auto all_rays = rays.load(std::memory_order_relaxed);
            const auto all_ns = ns.load(std::memory_order_relaxed);
            return all_rays == 0 ? double{infinity}
                                 : static_cast<double>(all_ns) / static_cast<double>(all_rays);
        }
    };

    std::atomic<std::uint32_t> begun_{0};
    std::array<Runner, most> runners_;
    const std::size_t likely_, count_;
};

}  // namespace raydix
