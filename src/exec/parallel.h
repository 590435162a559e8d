// Parallel loops. The only doors to the thread pool: nothing else in the project knows which one it
// is.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <type_traits>

namespace raydix {

/// Runs `body` with at most `threads` threads at work in the loops inside it. 0, or more than the
/// machine has: all it has. Exceptions of the loops come out of here. Throws InputError unless
/// `threads` is 0 to 1,024: every call with an option of that name comes through here.
void with_threads(int threads, const std::function<void()>& body);

/// How many threads the loops of the calling context may use.
[[nodiscard]] int thread_count();

/// Calls body() within a loop so that the calling thread takes no other part of that loop up while
/// loops inside of body wait: what body holds, a mutex for one, stays out of reach of itself. On
/// the caller's own pool, which may give that thread any other task, its loops stay on the thread.
void isolated(const std::function<void()>& body);

namespace detail {
inline constinit thread_local bool loops_stay = false;
void parallel_ranges(std::size_t n, std::size_t grain,
                     void (*call)(const void*, std::size_t, std::size_t), const void* body);
}  // namespace detail

/// Calls body(begin, end) for ranges that cover [0, n), each at least `grain` long unless n is
/// less. What a body throws comes out, and other ranges may then be left out. Loops that bodies run
/// are not: each of them does all it should, or throws.
template <class Body>
void for_each_range(std::size_t n, std::size_t grain, const Body& body) {
    detail::parallel_ranges(
        n, grain,
        [](const void* b, std::size_t begin, std::size_t end) {
            (*static_cast<const Body*>(b))(begin, end);
        },
        &body);
}

/// Calls body(i) for i in [0, n) in any order and on any thread.
template <class Body>
void for_each_index(std::size_t n, const Body& body, std::size_t grain = 4096) {
    for_each_range(n, grain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) body(i);
    });
}

/// The same for what must not end half-way, with bodies that never throw and may run twice: where
/// the caller's thread pool refuses the loop, this thread runs all of it.
template <class Body>
void for_each_index_to_the_end(std::size_t n, const Body& body) {
    try {
        for_each_index(n, body);
    } catch (...) {
        for (std::size_t i = 0; i < n; ++i) body(i);
    }
}

/// While it lives, the loops that this thread begins stay on it: for pieces of work so small that
/// to share one would cost more than it gains, of which many are done side by side.
class LoopsStayHere {
public:
    LoopsStayHere() { detail::loops_stay = true; }
    ~LoopsStayHere() { detail::loops_stay = outer_; }
    LoopsStayHere(const LoopsStayHere&) = delete;
    LoopsStayHere& operator=(const LoopsStayHere&) = delete;

private:
    const bool outer_ = detail::loops_stay;
};

/// Splits [0, n) into fixed blocks that depend on n and `block` alone, never on the thread count,
/// and calls body(block_index, begin, end): what is summed per block and then in order is the same
/// on every machine.
template <class Body>
void for_each_block(std::size_t n, std::size_t block, const Body& body) {
    const std::size_t blocks = (n + block - 1) / block;
    for_each_range(blocks, 1, [&](std::size_t first, std::size_t last) {
        for (std::size_t b = first; b < last; ++b) {
            const std::size_t begin = b * block;
            body(b, begin, begin + block < n ? begin + block : n);
        }
    });
}

}  // namespace raydix
