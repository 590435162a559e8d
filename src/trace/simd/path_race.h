// Streams or packets for the jobs of one batch, whichever takes less time for a ray. Which is
// better for rays that ask for any hit cannot be told from the rays: short ones of one origin that
// mostly miss are best in packets, those that go deep into the tree in streams.
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

    /// The path for the next job: each once at first, then the faster one of all jobs so far.
    [[nodiscard]] SimdPath next() {
        for (const SimdPath path : {SimdPath::stream, SimdPath::packet})
            if (!of(path).tried.exchange(true, std::memory_order_relaxed)) return path;
        const double stream = ns_a_ray(SimdPath::stream), packet = ns_a_ray(SimdPath::packet);
        return packet > 0 && packet < stream ? SimdPath::packet : SimdPath::stream;
    }
    void add(SimdPath path, std::size_t rays, std::int64_t ns) {
        of(path).rays.fetch_add(static_cast<std::int64_t>(rays), std::memory_order_relaxed);
        of(path).ns.fetch_add(ns, std::memory_order_relaxed);
    }

private:
    struct Runner {
        std::atomic<bool> tried{false};
        std::atomic<std::int64_t> rays{0}, ns{0};
    };
    [[nodiscard]] Runner& of(SimdPath path) { return runners_[path == SimdPath::packet ? 1 : 0]; }
    /// 0 before the first job has ended.
    [[nodiscard]] double ns_a_ray(SimdPath path) {
        const auto rays = of(path).rays.load(std::memory_order_relaxed);
        const auto ns = of(path).ns.load(std::memory_order_relaxed);
        return rays == 0 ? 0.0 : static_cast<double>(ns) / static_cast<double>(rays);
    }

    std::array<Runner, 2> runners_;
};

}  // namespace raydix
