// Loops of the library on threads that the caller owns.
#pragma once

#include <cstddef>
#include <functional>

namespace raydix {

/// A thread pool of the caller's, as two functions.
struct ThreadPool {
    /// Returns how many threads can work on one loop at once, the calling one included. Less than 1
    /// counts as 1. Asked at each loop, so the answer may change.
    std::function<int()> workers = {};
    /// Calls job(i) once for each i in [0, jobs), on any threads and in any order, and returns when
    /// all calls have returned. A job never throws and waits for no other job, so that one thread
    /// may run all of them. Several threads may call this at once. What it throws before the first
    /// job ran comes out of the library's call. Only loops that change a tree in place, which would
    /// end half-way, then run on the calling thread.
    std::function<void(std::size_t jobs, const std::function<void(std::size_t)>& job)> run = {};
};

/// From now on all loops of the library run on this pool. An empty ThreadPool gives them back to
/// the library's own threads. No call of the library may be at work meanwhile, on any thread.
///
/// A loop inside a job stays on that job's thread. Options named `threads` are a limit as before:
/// a loop then has that many jobs at most. No result depends on the pool. Throws InputError if only
/// one of the functions is given.
void use_thread_pool(ThreadPool pool);

/// Whether this build has oneTBB. Without it the library's own threads are those of the standard
/// library: each thread that calls keeps its own helpers, and a loop inside a loop stays on its
/// thread.
[[nodiscard]] bool has_onetbb();

}  // namespace raydix
