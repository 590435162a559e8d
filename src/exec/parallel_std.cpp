// The loops of parallel.h on threads of the standard library, for the thread sanitizer: it cannot
// see how an uninstrumented oneTBB hands work over, and would report that instead of our own races.
#if defined(__SANITIZE_THREAD__)

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>

#include "base/float_env.h"
#include "base/options.h"
#include "exec/crew.h"
#include "exec/parallel.h"

namespace raydix {
namespace {

thread_local int thread_limit = 0;      // 0: all the machine has
thread_local bool inside_loop = false;  // a loop within a loop stays on its thread

class Restore {
public:
    Restore(int limit, bool inside) : limit_(thread_limit), inside_(inside_loop) {
        thread_limit = limit;
        inside_loop = inside;
    }
    ~Restore() {
        thread_limit = limit_;
        inside_loop = inside_;
    }
    Restore(const Restore&) = delete;
    Restore& operator=(const Restore&) = delete;

private:
    int limit_;
    bool inside_;
};

/// What the threads of one loop share.
struct SharedLoop {
    std::size_t n, step;
    void (*call)(const void*, std::size_t, std::size_t);
    const void* body;
    std::atomic<std::size_t> next{0};
    std::mutex failing;
    std::exception_ptr failure;

    void work() {
        const FloatEnvironment plain;
        const Restore within(1, true);
        try {
            // Relaxed: to take a range from each other must not order what threads do with theirs.
            for (std::size_t begin; (begin = next.fetch_add(step, std::memory_order_relaxed)) < n;)
                call(body, begin, std::min(begin + step, n));
        } catch (...) {
            const std::scoped_lock lock(failing);
            if (!failure) failure = std::current_exception();
        }
    }
};

}  // namespace

void with_threads(int threads, const std::function<void()>& body) {
    check_threads(threads);
    const FloatEnvironment plain;
    constexpr int most = 16;  // each calling thread has a crew of its own
    const Restore limited(threads > 0 ? std::min(threads, most) : thread_limit, inside_loop);
    body();
}

int thread_count() {
    if (inside_loop) return 1;
    static const int all = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    return thread_limit > 0 ? thread_limit : all;
}

void isolated(const std::function<void()>& body) { body(); }  // loops take up nothing else

namespace detail {

void parallel_ranges(std::size_t n, std::size_t grain,
                     void (*call)(const void*, std::size_t, std::size_t), const void* body) {
    if (n == 0) return;
    const auto threads = static_cast<std::size_t>(thread_count());
    if (n <= grain || threads == 1) {
        const FloatEnvironment plain;
        call(body, 0, n);
        return;
    }
    SharedLoop loop{n, std::max(grain, n / (8 * threads)), call, body, {}, {}, {}};
    thread_local Crew crew;
    crew.run(threads - 1, [&loop] { loop.work(); });
    if (loop.failure) std::rethrow_exception(loop.failure);
}

}  // namespace detail
}  // namespace raydix

#endif
