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

    static constexpr std::size_t most = 3;
    /// Between `count` ways, the first one where nothing is known yet. At most `most`.
    explicit PathRace(std::size_t count) : count_(std::min(count, most)) {}

    /// The way of the next job: all by turns at first, then the fastest one of all jobs so far.
    [[nodiscard]] std::size_t next() {
        const std::uint32_t job = begun_.fetch_add(1, std::memory_order_relaxed);
        if (job < trials()) return job % count_;
        std::size_t best = 0;
        double least = infinity;
        for (std::size_t k = 0; k < most; ++k)
            if (const double ns = runners_[k].ns_a_ray(); ns < least) least = ns, best = k;
        return best;
    }
    /// A job has ended. The first one of each way does not count: it found memory as it was.
    void add(std::size_t way, std::size_t rays, std::int64_t ns) {
        if (way < most) runners_[way].add(rays, ns);
    }

    /// Jobs that are shared out whatever they take.
    [[nodiscard]] std::uint32_t trials() const { return 2 * static_cast<std::uint32_t>(count_); }

private:
    struct Runner {
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
    std::array<Runner, most> runners_;
    const std::size_t count_;
};

}  // namespace raydix
