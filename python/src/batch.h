// How a batch runs from Python: without the interpreter's lock, in pieces, so that Ctrl-C is heard.
#pragma once

#include <nanobind/nanobind.h>

#include <algorithm>
#include <cstddef>

namespace raydix::python {

/// Queries between two looks for signals: some ten milliseconds of work, enough to keep threads
/// busy and to let batches be sorted.
inline constexpr std::size_t piece_size = std::size_t{1} << 20;

/// Runs Python's signal handlers, if this is the thread that may; throws what they raise.
inline void hear_signals() {
    if (PyErr_CheckSignals() != 0) throw nanobind::python_error();
}

/// Calls body(begin, end) for pieces of [0, n) in order, without the interpreter's lock. Called
/// with it.
template <class Body>
void in_pieces(std::size_t n, const Body& body) {
    for (std::size_t begin = 0; begin < n; begin += piece_size) {
        if (begin != 0) hear_signals();
        const nanobind::gil_scoped_release unlocked;
        body(begin, std::min(n, begin + piece_size));
    }
}

/// What to ask the library for: all threads of the machine, unless this process is a fork of one
/// that had started them. Threads do not survive a fork, and a pool does not know.
[[nodiscard]] int threads_for(int asked);

}  // namespace raydix::python
