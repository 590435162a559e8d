// Locks on what many threads ask and one changes.
#pragma once

#include <atomic>
#include <mutex>
#include <shared_mutex>
#include <utility>

namespace raydix::python {

/// The locks of a scene or an index. In a forked child they are free: the threads that held them
/// are not there. What another thread was changing at that moment is never asked again.
class Locks {
public:
    Locks();
    ~Locks();
    Locks(const Locks&) = delete;
    Locks& operator=(const Locks&) = delete;

    /// Held by the one thread that builds what all of those who ask need; the others wait.
    [[nodiscard]] std::mutex& build() { return build_; }

    /// While this lives, what the locks guard is half of one and half of another.
    class Change {
    public:
        explicit Change(Locks& locks) : locks_(locks) { ++locks_.changes_; }
        ~Change() { --locks_.changes_; }
        Change(const Change&) = delete;
        Change& operator=(const Change&) = delete;

    private:
        Locks& locks_;
    };

    // For pthread_atfork.
    static void before_fork();
    static void after_fork();
    static void in_forked_child();

private:
    friend class Reading;
    friend class Writing;

    /// Throws InputError, which names the call, if a fork left it half changed.
    void require_whole(const char* call) const;

    std::mutex queue_;  // without it, readers would keep a change waiting for ever
    std::shared_mutex use_;
    std::mutex build_;
    std::atomic<int> changes_{0};
    bool is_broken_ = false;
    static inline unsigned forks_ = 0;  // from the first process to this one
};

/// A lock on a scene that is read, and the knowledge that this thread has one: Python may run a
/// signal handler between two pieces of a batch, which may ask a scene again.
class Reading {
public:
    Reading() = default;
    /// Waits for the change that is going on, not for those that wait as well. Throws InputError,
    /// which names the call, if a fork left it half changed.
    Reading(const char* call, Locks& locks);
    /// As others do: changes that wait go first, unless this thread reads already, the end of which
    /// they wait for.
    [[nodiscard]] static Reading in_turn(const char* call, Locks& locks);
    Reading(Reading&& other) noexcept : lock_(std::move(other.lock_)), forks_(other.forks_) {}
    Reading& operator=(Reading&& other) noexcept {
        Reading moved(std::move(other));
        lock_.swap(moved.lock_);
        std::swap(forks_, moved.forks_);
        return *this;
    }
    ~Reading() {
        if (!lock_.owns_lock()) return;
        --held_;
        if (forks_ != Locks::forks_) static_cast<void>(lock_.release());  // it is another one now
    }

    [[nodiscard]] bool owns_lock() const { return lock_.owns_lock(); }
    /// How many this thread has.
    [[nodiscard]] static int held() { return held_; }

private:
    std::shared_lock<std::shared_mutex> lock_;
    unsigned forks_ = 0;
    static inline thread_local int held_ = 0;
};

/// The lock of the one thread that changes a scene.
class Writing {
public:
    /// Throws InputError, which names the call, in a signal handler within a query or a change,
    /// whose end it would wait for, and as Reading does.
    Writing(const char* call, Locks& locks);
    Writing(const Writing&) = delete;
    Writing& operator=(const Writing&) = delete;
    ~Writing();

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
    friend class Locks;

    Locks& locks_;
    std::unique_lock<std::mutex> queue_;
    std::unique_lock<std::shared_mutex> use_;
    unsigned forks_ = Locks::forks_;
    static inline thread_local bool is_held_ = false;
};

}  // namespace raydix::python
