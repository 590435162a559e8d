// The loops of parallel.h on oneTBB. Every range runs in a plain floating-point environment.
#if !defined(__SANITIZE_THREAD__)  // parallel_std.cpp serves there

#include "exec/parallel.h"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

#include "base/float_env.h"
#include "base/options.h"
#include "exec/progress.h"

namespace raydix {

void with_threads(int threads, const std::function<void()>& body) {
    check_threads(threads);
    const FloatEnvironment plain;
    if (threads == 0) {
        body();
        return;
    }
    // An arena that asks for more than the process may have at work gets no more, and oneTBB prints
    // a warning.
    const std::size_t most =
        tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
    const int wanted = static_cast<int>(std::min(static_cast<std::size_t>(threads), most));
    // Workers take a millisecond to come over to another arena.
    if (wanted == thread_count()) {
        body();
        return;
    }
    tbb::task_arena arena(wanted);
    const ProgressSpan progress = progress_span();
    arena.execute([&] {
        const ProgressStage same(progress);
        body();
    });
}

void isolated(const std::function<void()>& body) { tbb::this_task_arena::isolate(body); }

int thread_count() { return tbb::this_task_arena::max_concurrency(); }

namespace detail {

void parallel_ranges(std::size_t n, std::size_t grain,
                     void (*call)(const void*, std::size_t, std::size_t), const void* body) {
    if (n == 0) return;
    if (n <= grain || thread_count() == 1) {
        const FloatEnvironment plain;
        call(body, 0, n);
        return;
    }
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, grain),
                      [&](const tbb::blocked_range<std::size_t>& range) {
                          const FloatEnvironment plain;
                          call(body, range.begin(), range.end());
                      });
}

}  // namespace detail
}  // namespace raydix

#endif
