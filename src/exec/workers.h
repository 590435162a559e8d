// Whether the workers of the loops are there: a forked child has none of its parent's threads, and
// finds locks as these held them.
#pragma once

#if __has_include(<pthread.h>)
#include <pthread.h>
#endif

#include <atomic>

namespace raydix {
namespace detail {

inline std::atomic<bool> workers_were_used{false}, workers_are_gone{false};
#if __has_include(<pthread.h>)
[[maybe_unused]] inline const int at_fork = pthread_atfork(nullptr, nullptr, [] {
    if (workers_were_used) workers_are_gone = true;
});
#endif

}  // namespace detail

/// Whether this process was forked off one whose loops had used workers. It has one thread.
[[nodiscard]] inline bool workers_are_gone() { return detail::workers_are_gone; }

/// Whether loops may go to workers, which count as used from then on.
[[nodiscard]] inline bool workers_serve() {
    if (workers_are_gone()) return false;
    detail::workers_were_used = true;
    return true;
}

}  // namespace raydix
