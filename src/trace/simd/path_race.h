// Streams or packets for the jobs of one batch, whichever takes less time for a ray. Which is
// better cannot be told from the rays: it depends on how many of them go the same way in the tree
// and how deep, so on the scene too.
#pragma once

#include <raydix/trace.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <ctime>

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

    /// The path for the next job: both by turns at first, then the faster one of all jobs so far.
    [[nodiscard]] SimdPath next() {
        const std::uint32_t job = begun_.fetch_add(1, std::memory_order_relaxed);
        if (job < trials) return job % 2 == 0 ? SimdPath::stream : SimdPath::packet;
        const double stream = ns_a_ray(SimdPath::stream), packet = ns_a_ray(SimdPath::packet);
        return packet > 0 && packet < stream ? SimdPath::packet : SimdPath::stream;
    }
    /// A job has ended. The first one of each path does not count: it found memory as it was.
    void add(SimdPath path, std::size_t rays, std::int64_t ns) {
        if (!of(path).warm.exchange(true, std::memory_order_relaxed)) return;
        of(path).rays.fetch_add(static_cast<std::int64_t>(rays), std::memory_order_relaxed);
        of(path).ns.fetch_add(ns, std::memory_order_relaxed);
    }

    /// Jobs that are shared out whatever they take.
    static constexpr std::uint32_t trials = 4;

private:
    struct Runner {
        std::atomic<bool> warm{false};
        std::atomic<std::int64_t> rays{0}, ns{0};
    };
    [[nodiscard]] Runner& of(SimdPath path) { return runners_[path == SimdPath::packet ? 1 : 0]; }
    /// 0 before the second job has ended.
    [[nodiscard]] double ns_a_ray(SimdPath path) {
        const auto rays = of(path).rays.load(std::memory_order_relaxed);
        const auto ns = of(path).ns.load(std::memory_order_relaxed);
        return rays == 0 ? 0.0 : static_cast<double>(ns) / static_cast<double>(rays);
    }

    std::atomic<std::uint32_t> begun_{0};
    std::array<Runner, 2> runners_;
};

}  // namespace raydix
