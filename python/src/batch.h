// How a batch runs from Python: without the interpreter's lock, in pieces, so that Ctrl-C is heard.
#pragma once

#include <nanobind/nanobind.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <functional>
#include <thread>

namespace raydix::python {

/// Queries between two looks for signals, at most: enough to keep threads busy and to let batches
/// be sorted.
inline constexpr std::size_t piece_size = std::size_t{1} << 20;
/// Of the first piece, before it is known how long a query takes.
inline constexpr std::size_t first_piece = 4096;
/// The same where all answers are listed: more pieces take a copy at the end.
inline constexpr std::size_t first_listed = piece_size / 64;

/// Runs Python's signal handlers, if this is the thread that may; throws what they raise.
inline void hear_signals() {
    if (PyErr_CheckSignals() != 0) throw nanobind::python_error();
}

/// What the library may call with its progress, from any thread and without the interpreter's lock:
/// the one that calls this now hears signals.
[[nodiscard]] inline std::function<void(double)> hear_signals_on_this_thread() {
    return [caller = std::this_thread::get_id()](double) {
        if (std::this_thread::get_id() != caller) return;
        const nanobind::gil_scoped_acquire locked;
        hear_signals();
    };
}

/// Calls body(begin, end) for pieces of [0, n) in order, without the interpreter's lock. Called
/// with it. The first has `first` queries; the others more or fewer, by how long it took. No
/// queries are one piece: what is wrong besides them is told.
template <class Body>
void in_pieces(std::size_t n, const Body& body, std::size_t first = first_piece) {
    using Clock = std::chrono::steady_clock;
    constexpr auto short_time = std::chrono::milliseconds(100), long_time = 5 * short_time;
    constexpr std::size_t smallest = 1024;
    std::size_t size = first;
    std::size_t begin = 0;
    do {
        if (begin != 0) hear_signals();
        const std::size_t end = std::min(n, begin + size);
        const nanobind::gil_scoped_release unlocked;
        const auto start = Clock::now();
        body(begin, end);
        const auto time = Clock::now() - start;
        if (time < short_time)
            size = std::min(4 * size, piece_size);
        else if (time > long_time)
            size = std::max(size / 4, smallest);
        begin = end;
    } while (begin < n);
}

/// What to ask the library for: all threads of the machine, unless this process is a fork of one
/// that had started them. Threads do not survive a fork, and a pool does not know. Throws
/// InputError: not 0 to 1024.
[[nodiscard]] int threads_for(int asked);

}  // namespace raydix::python
