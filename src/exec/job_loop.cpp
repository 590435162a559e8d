// Jobs that share a loop, and the thread pool of the caller's that may run them.
#include "exec/job_loop.h"

#include <raydix/error.h>
#include <raydix/thread_pool.h>

#include <algorithm>
#include <utility>

#include "base/float_env.h"

namespace raydix {
namespace {

thread_local int job_limit = 0;  // 0: all there are
thread_local bool inside_job = false;

class Restore {
public:
    Restore(int limit, bool inside) : limit_(job_limit), inside_(inside_job) {
        job_limit = limit;
        inside_job = inside;
    }
    ~Restore() {
        job_limit = limit_;
        inside_job = inside_;
    }
    Restore(const Restore&) = delete;
    Restore& operator=(const Restore&) = delete;

private:
    int limit_;
    bool inside_;
};

std::atomic<bool> used = false;
ThreadPool& pool() {
    static ThreadPool handed_over;
    return handed_over;
}

}  // namespace

JobLoop::JobLoop(std::size_t n, std::size_t grain, std::size_t jobs, Call call, const void* body)
    : n_(n), step_(std::max({grain, n / (8 * jobs), std::size_t{1}})), call_(call), body_(body) {}

void JobLoop::work() noexcept {
    const FloatEnvironment plain;
    const Restore within(1, true);
    try {
        // Relaxed: to take a range from each other must not order what threads do with theirs.
        for (std::size_t begin; (begin = next_.fetch_add(step_, std::memory_order_relaxed)) < n_;)
            call_(body_, begin, std::min(begin + step_, n_));
    } catch (...) {
        const std::scoped_lock lock(failing_);
        if (!failure_) failure_ = std::current_exception();
    }
}

int jobs_at_once(int usual, int most) {
    if (inside_job) return 1;
    return std::max(1, job_limit > 0 ? std::min(job_limit, most) : usual);
}

void with_job_limit(int threads, const std::function<void()>& body) {
    const Restore limited(threads > 0 ? threads : job_limit, inside_job);
    body();
}

void as_job(const std::function<void()>& body) {
    const Restore within(job_limit, true);
    body();
}

bool pool_is_used() { return used.load(std::memory_order_acquire); }

int pool_threads() {
    const int workers = pool().workers();
    return jobs_at_once(workers, workers);
}

void run_on_pool(std::size_t n, std::size_t grain, JobLoop::Call call, const void* body) {
    const std::size_t ranges =
        (n + std::max(grain, std::size_t{1}) - 1) / std::max(grain, std::size_t{1});
    const std::size_t jobs = std::min(ranges, static_cast<std::size_t>(pool_threads()));
    JobLoop loop(n, grain, jobs, call, body);
    pool().run(jobs, [&loop](std::size_t) { loop.work(); });
    loop.rethrow();
}

void use_thread_pool(ThreadPool given) {
    if (static_cast<bool>(given.workers) != static_cast<bool>(given.run))
        throw InputError("a thread pool needs both functions, workers and run; one is missing");
    const bool filled = static_cast<bool>(given.run);
    used.store(false, std::memory_order_release);
    pool() = std::move(given);
    used.store(filled, std::memory_order_release);
}

}  // namespace raydix
