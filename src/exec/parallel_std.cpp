// The loops of parallel.h on threads of the standard library, for builds without oneTBB and for the
// thread sanitizer: it cannot see how an uninstrumented oneTBB hands work over, and would report
// that instead of our own races.
#if defined(__SANITIZE_THREAD__) || defined(RAYDIX_NO_TBB)

#include <raydix/thread_pool.h>

#include <algorithm>
#include <memory>
#include <thread>

#include "base/float_env.h"
#include "base/options.h"
#include "exec/crew.h"
#include "exec/job_loop.h"
#include "exec/parallel.h"
#include "exec/workers.h"

namespace raydix {
namespace {

int machine_threads() {
    static const int all = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    return all;
}

/// Each calling thread has a crew of its own. More than the machine has are only there so that
/// tests see more of them meet.
int most_threads() { return std::max(16, machine_threads()); }

/// The calling thread's crew. In a forked child it has no threads to wait for, and is left.
class OwnCrew {
public:
    OwnCrew() = default;
    ~OwnCrew() {
        if (workers_are_gone()) static_cast<void>(crew_.release());
    }
    OwnCrew(const OwnCrew&) = delete;
    OwnCrew& operator=(const OwnCrew&) = delete;
    Crew* operator->() const { return crew_.get(); }

private:
    std::unique_ptr<Crew> crew_ = std::make_unique<Crew>();
};

}  // namespace

void with_threads(int threads, const std::function<void()>& body) {
    check_threads(threads);
    const FloatEnvironment plain;
    if (detail::loops_stay)
        body();
    else
        with_job_limit(threads, body);
}

int thread_count() {
    if (detail::loops_stay) return 1;
    if (pool_is_used()) return pool_threads();
    return workers_serve() ? jobs_at_once(machine_threads(), most_threads()) : 1;
}

void isolated(const std::function<void()>& body) {
    if (pool_is_used())
        as_job(body);  // a pool may run any of its tasks while a loop waits
    else
        body();
}

bool has_onetbb() { return false; }

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
    if (pool_is_used()) {
        run_on_pool(n, grain, call, body);
        return;
    }
    JobLoop loop(n, grain, threads, call, body);
    thread_local OwnCrew crew;
    crew->run(threads - 1, [&loop] { loop.work(); });
    loop.rethrow();
}

}  // namespace detail
}  // namespace raydix

#endif
