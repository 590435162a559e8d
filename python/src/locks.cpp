// Who waits for whom, and what is left of it in a forked child.
#include "locks.h"

#include <raydix/error.h>

#include <memory>
#include <set>
#include <string>

namespace raydix::python {
namespace {

/// All locks that there are. Held from before a fork until after it, so that it is whole then.
struct Registry {
    std::mutex mutex;
    std::set<Locks*> all;
};

Registry& registry() {
    static auto* const made = new Registry;  // outlives what Python frees last
    return *made;
}

std::mutex& unless_reading(const char* call, std::mutex& queue) {
    Writing::require_none(call);
    if (Reading::held() != 0)
        throw InputError(std::string(call) +
                         ": this thread is within a query of a scene, in a signal handler");
    return queue;
}

}  // namespace

Locks::Locks() {
    const std::lock_guard lock(registry().mutex);
    registry().all.insert(this);
}

Locks::~Locks() {
    const std::lock_guard lock(registry().mutex);
    registry().all.erase(this);
}

void Locks::require_whole(const char* call) const {
    if (is_broken_)
        throw InputError(std::string(call) +
                         ": another thread was changing it when this process was forked off; make "
                         "it again");
}

void Locks::before_fork() { registry().mutex.lock(); }

void Locks::after_fork() { registry().mutex.unlock(); }

void Locks::in_forked_child() {
    ++forks_;
    for (Locks* const locks : registry().all) {
        // Not destroyed before: nobody who held one of them will let it go.
        std::construct_at(&locks->queue_);
        std::construct_at(&locks->use_);
        std::construct_at(&locks->build_);
        if (locks->changes_ != 0 && !Writing::is_held_) locks->is_broken_ = true;
    }
    std::construct_at(&registry().mutex);
}

Reading::Reading(const char* call, Locks& locks) : lock_(locks.use_), forks_(Locks::forks_) {
    locks.require_whole(call);
    ++held_;
}

Reading Reading::in_turn(const char* call, Locks& locks) {
    if (held_ != 0) return {call, locks};
    const std::lock_guard queue(locks.queue_);
    return {call, locks};
}

Writing::Writing(const char* call, Locks& locks)
    : locks_(locks), queue_(unless_reading(call, locks.queue_)), use_(locks.use_) {
    locks.require_whole(call);
    ++locks_.changes_;
    is_held_ = true;
}

Writing::~Writing() {
    is_held_ = false;
    --locks_.changes_;
    if (forks_ == Locks::forks_) return;
    static_cast<void>(queue_.release());
    static_cast<void>(use_.release());
}

void Writing::require_none(const char* call) {
    if (is_held_)
        throw InputError(std::string(call) +
                         ": this thread is within a change of a scene, in a signal handler or a "
                         "progress function");
}

}  // namespace raydix::python
