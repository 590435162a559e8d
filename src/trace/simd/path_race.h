// The path for the jobs of one batch: the one that takes the least time for a ray. It cannot be
// told from the rays: it depends on how many of them go the same way in the tree and how deep, so
// on the scene too.
#pragma once

#include <raydix/trace.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <initializer_list>

#include "base/math.h"

namespace raydix {

class PathRace {
public:
    /// Processor time of this thread, so that other programs decide nothing.
    [[nodiscard]] static std::int64_t thread_ns() {
#if defined(CLOCK_THREAD_CPUTIME_ID)
        std::timespec now{};
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
        return std::int64_t{now.tv_sec} * 1000000000 + now.tv_nsec;
#else
        return 0;  // streams then
#endif
    }

    /// `paths`: at most three; the first one where nothing is known yet.
    explicit PathRace(std::initializer_list<SimdPath> paths) {
        for (const SimdPath path : paths) runners_.at(count_++).path = path;
    }

    /// The path for the next job: all by turns at first, then the fastest one of all jobs so far.
    [[nodiscard]] SimdPath next() {
        const std::uint32_t job = begun_.fetch_add(1, std::memory_order_relaxed);
        if (job < trials()) return runners_[job % count_].path;
        SimdPath best = runners_[0].path;
        double least = infinity;
        for (const Runner& runner : runners_)
            if (const double ns = runner.ns_a_ray(); ns < least) least = ns, best = runner.path;
        return best;
    }
    /// A job has ended. The first one of each path does not count: it found memory as it was.
    void add(SimdPath path, std::size_t rays, std::int64_t ns) {
        for (Runner& runner : runners_)
            if (runner.path == path) return runner.add(rays, ns);
    }

    /// Jobs that are shared out whatever they take.
    [[nodiscard]] std::uint32_t trials() const { return 2 * static_cast<std::uint32_t>(count_); }

private:
    struct Runner {
        SimdPath path = SimdPath::automatic;  // none
        std::atomic<bool> warm{false};
        std::atomic<std::int64_t> rays{0}, ns{0};

        void add(std::size_t more_rays, std::int64_t more_ns) {
            if (!warm.exchange(true, std::memory_order_relaxed)) return;
            rays.fetch_add(static_cast<std::int64_t>(more_rays), std::memory_order_relaxed);
            ns.fetch_add(more_ns, std::memory_order_relaxed);
        }
        /// Infinite before the second job has ended.
        [[nodiscard]] double ns_a_ray() const {
            const auto all_rays = rays.load(std::memory_order_relaxed);
            const auto all_ns = ns.load(std::memory_order_relaxed);
            return all_rays == 0 ? double{infinity}
                                 : static_cast<double>(all_ns) / static_cast<double>(all_rays);
        }
    };

    std::atomic<std::uint32_t> begun_{0};
    std::array<Runner, 3> runners_;
    std::size_t count_ = 0;
};

}  // namespace raydix
