// Threads that are kept from one loop to the next, for the thread sanitizer: there, to make and end
// a thread takes two milliseconds of a processor, more than most loops of the tests.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace raydix {

/// For one caller at a time. Its threads meet the caller and nobody else, so what other callers do
/// at the same time stays unordered, and their races are seen.
class Crew {
public:
    Crew() = default;
    Crew(const Crew&) = delete;
    Crew& operator=(const Crew&) = delete;
    ~Crew() {
        {
            const std::scoped_lock lock(mutex_);
            ending_ = true;
        }
        work_came_.notify_all();
        for (std::thread& thread : threads_) thread.join();
    }

    /// Calls work() on `helpers` threads and, once all of these have begun, on the calling one.
    /// Returns when all calls have. work must not throw.
    void run(std::size_t helpers, const std::function<void()>& work) {
        std::unique_lock lock(mutex_);
        while (threads_.size() < helpers) threads_.emplace_back([this] { serve(); });
        work_ = &work;
        to_begin_ = at_work_ = helpers;
        for (std::size_t i = 0; i < helpers; ++i) work_came_.notify_one();
        caller_.wait(lock, [&] { return to_begin_ == 0; });
        lock.unlock();
        work();
        lock.lock();
        caller_.wait(lock, [&] { return at_work_ == 0; });
    }

private:
    void serve() {
        std::unique_lock lock(mutex_);
        for (;;) {
            work_came_.wait(lock, [&] { return to_begin_ > 0 || ending_; });
            if (ending_) return;
            const std::function<void()>& work = *work_;
            if (--to_begin_ == 0) caller_.notify_one();
            lock.unlock();
            work();
            lock.lock();
            if (--at_work_ == 0) caller_.notify_one();
        }
    }

    std::mutex mutex_;
    std::condition_variable work_came_, caller_;
    const std::function<void()>* work_ = nullptr;
    std::size_t to_begin_ = 0, at_work_ = 0;
    bool ending_ = false;
    std::vector<std::thread> threads_;
};

}  // namespace raydix
