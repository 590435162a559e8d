// Blocks of a loop that threads take from one counter, large ones first: guided self-scheduling
// (Polychronopoulos and Kuck 1987). Large blocks keep the kernels' vectors full. The small ones at
// the end keep every thread busy until all is done, however much blocks differ in cost.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <vector>

#include "exec/parallel.h"

namespace raydix {

/// Blocks of [0, n).
class JobBlocks {
public:
    /// Each `block` long, but for the last one. They do not depend on the threads.
    static JobBlocks fixed(std::size_t n, std::size_t block) { return {n, block}; }

    /// Each half of what a thread's even share of the rest would be, in multiples of `unit`, up to
    /// `largest`. One thread has the largest ones alone.
    static JobBlocks guided(std::size_t n, std::size_t unit, std::size_t largest,
                            std::size_t threads) {
        JobBlocks blocks(n, largest);
        if (threads < 2 || n <= unit) return blocks;
        for (std::size_t end = 0; end < n;) {
            const std::size_t share = (n - end) / (2 * threads);
            end += std::clamp(share / unit * unit, unit, largest);
            blocks.ends_.push_back(std::min(end, n));
        }
        return blocks;
    }

    [[nodiscard]] std::size_t count() const {
        return ends_.empty() ? (n_ + block_ - 1) / block_ : ends_.size();
    }

    /// Calls body(number, begin, end) for each block, on as many threads as there are to have.
    template <class Body>
    void run(const Body& body) const {
        std::atomic<std::size_t> next{0};
        const auto threads = static_cast<std::size_t>(thread_count());
        for_each_range(std::min(count(), threads), 1, [&](std::size_t, std::size_t) {
            // Relaxed: to take a block must not order what threads do with theirs.
            for (std::size_t b; (b = next.fetch_add(1, std::memory_order_relaxed)) < count();)
                body(b, begin_of(b), end_of(b));
        });
    }

private:
    JobBlocks(std::size_t n, std::size_t block) : n_(n), block_(block) {}

    [[nodiscard]] std::size_t begin_of(std::size_t b) const {
        if (ends_.empty()) return b * block_;
        return b == 0 ? 0 : ends_[b - 1];
    }
    [[nodiscard]] std::size_t end_of(std::size_t b) const {
        return ends_.empty() ? std::min((b + 1) * block_, n_) : ends_[b];
    }

    std::size_t n_, block_;
    std::vector<std::size_t> ends_{};  // of guided blocks
};

}  // namespace raydix
