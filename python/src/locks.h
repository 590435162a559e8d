// Locks on what many threads ask and one changes.
#pragma once

#include <mutex>
#include <shared_mutex>
#include <utility>

namespace raydix::python {

/// A lock on a scene that is read, and the knowledge that this thread has one: Python may run a
/// signal handler between two pieces of a batch, which may ask a scene again.
class Reading {
public:
    Reading() = default;
    explicit Reading(std::shared_mutex& use) : lock_(use) { ++held_; }
    Reading(Reading&& other) noexcept : lock_(std::move(other.lock_)) {}
    Reading& operator=(Reading&& other) noexcept {
        Reading moved(std::move(other));
        lock_.swap(moved.lock_);
        return *this;
    }
    ~Reading() {
        if (lock_.owns_lock()) --held_;
    }

    [[nodiscard]] bool owns_lock() const { return lock_.owns_lock(); }
    /// How many this thread has.
    [[nodiscard]] static int held() { return held_; }

private:
    std::shared_lock<std::shared_mutex> lock_;
    static inline thread_local int held_ = 0;
};

/// The lock of the one thread that changes a scene.
class Writing {
public:
    /// Throws InputError, which names the call, in a signal handler within a query or a change,
    /// whose end it would wait for.
    Writing(const char* call, std::mutex& queue, std::shared_mutex& use);
    Writing(const Writing&) = delete;
    Writing& operator=(const Writing&) = delete;
    ~Writing() { is_held_ = false; }

    /// Throws InputError if this thread has one: Python may run a signal handler in a commit, and
    /// a commit calls its progress function.
    static void require_none(const char* call);

    /// While this lives, its thread counts as one that changes a scene: for one that a commit calls
    /// Python from, which would wait for ever for the end of that commit.
    class OnThread {
    public:
        OnThread() { is_held_ = true; }
        OnThread(const OnThread&) = delete;
        OnThread& operator=(const OnThread&) = delete;
        ~OnThread() { is_held_ = before_; }

    private:
        bool before_ = is_held_;
    };

private:
    std::unique_lock<std::mutex> queue_;
    std::unique_lock<std::shared_mutex> use_;
    static inline thread_local bool is_held_ = false;
};

}  // namespace raydix::python
