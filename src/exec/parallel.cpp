// The loops of parallel.h on oneTBB. Every range runs in a plain floating-point environment.
#if !defined(__SANITIZE_THREAD__) && !defined(RAYDIX_NO_TBB)  // parallel_std.cpp serves there

#include "exec/parallel.h"

#include <raydix/thread_pool.h>
#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <utility>

#include "base/float_env.h"
#include "base/options.h"
#include "exec/job_loop.h"
#include "exec/progress.h"
#include "exec/workers.h"

namespace raydix {
namespace {

thread_local bool inside_range = false;

/// A range that this thread runs.
class Range {
public:
    Range() = default;
    ~Range() { inside_range = outer_; }
    Range(const Range&) = delete;
    Range& operator=(const Range&) = delete;

private:
    const FloatEnvironment plain_;
    const bool outer_ = std::exchange(inside_range, true);
};

/// From within a range the caller's functions call the library again. While such a call waits for
/// others, its thread must not begin another range of the outer call: it could go on and on.
void run_here(const std::function<void()>& body) {
    if (inside_range)
        isolated(body);
    else
        body();
}

}  // namespace

void with_threads(int threads, const std::function<void()>& body) {
    check_threads(threads);
    const FloatEnvironment plain;
    if (detail::loops_stay) {
        body();
        return;
    }
    if (pool_is_used()) {
        with_job_limit(threads, body);
        return;
    }
    if (threads == 0 || !workers_serve()) {
        run_here(body);
        return;
    }
    // An arena that asks for more than the process may have at work gets no more, and oneTBB prints
    // a warning.
    const std::size_t most =
        tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
    const int wanted = static_cast<int>(std::min(static_cast<std::size_t>(threads), most));
    // Workers take a millisecond to come over to another arena.
    if (wanted == thread_count()) {
        run_here(body);
        return;
    }
    tbb::task_arena arena(wanted);
    const ProgressSpan progress = progress_span();
    arena.execute([&] {
        const ProgressStage same(progress);
        body();
    });
}

void isolated(const std::function<void()>& body) {
    if (pool_is_used())
        as_job(body);  // a pool may run any of its tasks while a loop waits
    else if (!workers_serve())
        body();
    else
        tbb::this_task_arena::isolate(body);
}

int thread_count() {
    if (detail::loops_stay) return 1;
    if (pool_is_used()) return pool_threads();
    return workers_serve() ? tbb::this_task_arena::max_concurrency() : 1;
}

bool has_onetbb() { return true; }

namespace detail {

void parallel_ranges(std::size_t n, std::size_t grain,
                     void (*call)(const void*, std::size_t, std::size_t), const void* body) {
    if (n == 0) return;
    if (n <= grain || thread_count() == 1) {
        const Range range;
        call(body, 0, n);
        return;
    }
    if (pool_is_used()) {
        run_on_pool(n, grain, call, body);
        return;
    }
    // A loop inside of another goes on when the other one ends by an exception. oneTBB would leave
    // ranges out and return as if all were done.
    tbb::task_group_context own(tbb::task_group_context::isolated);
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, n, grain),
        [&](const tbb::blocked_range<std::size_t>& range) {
            const Range inside;
            call(body, range.begin(), range.end());
        },
        own);
}

}  // namespace detail
}  // namespace raydix

#endif
