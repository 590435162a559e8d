// A loop as jobs that take their ranges from one counter: for the caller's thread pool, and for
// threads of the standard library.
#pragma once

#include <atomic>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>

namespace raydix {

/// What the jobs of one loop share.
class JobLoop {
public:
    using Call = void (*)(const void*, std::size_t, std::size_t);

    JobLoop(std::size_t n, std::size_t grain, std::size_t jobs, Call call, const void* body);
    /// One job. Returns when no range is left. Loops inside of it stay on this thread.
    void work() noexcept;
    /// Throws what the first body that failed threw.
    void rethrow() const {
        if (failure_) std::rethrow_exception(failure_);
    }

private:
    std::size_t n_, step_;
    Call call_;
    const void* body_;
    std::atomic<std::size_t> next_{0};
    std::mutex failing_;
    std::exception_ptr failure_;
};

/// How many jobs a loop on this thread may have: `usual` where nothing limits it, else the limit,
/// up to `most`; 1 inside a job.
[[nodiscard]] int jobs_at_once(int usual, int most);

/// Calls body() with at most `threads` jobs in each loop; 0 keeps the limit as it is.
void with_job_limit(int threads, const std::function<void()>& body);

/// Calls body() as a job does: its loops stay on this thread.
void as_job(const std::function<void()>& body);

/// Whether the caller has handed over a thread pool, how many it has, and a loop on it.
[[nodiscard]] bool pool_is_used();
[[nodiscard]] int pool_threads();
void run_on_pool(std::size_t n, std::size_t grain, JobLoop::Call call, const void* body);

}  // namespace raydix
