// Runs launches as a GPU may: elements in blocks, blocks and the elements inside them in an order
// drawn from a seed, blocks at work at the same time on real threads. What passes here under the
// thread sanitizer for many seeds does not lean on an order. The interface is that of
// exec/host_launcher.h.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <numeric>
#include <random>
#include <vector>

#include "exec/crew.h"
#include "exec/host_launcher.h"

namespace raydix::test {

class ShuffledLauncher {
public:
    using Probe = NoProbe;
    static constexpr std::uint32_t block_size = 64;

    explicit ShuffledLauncher(std::uint64_t seed, int threads = 3)
        : random_(seed), threads_(threads) {}

    template <class Work>
    void launch(const char*, std::uint32_t n, const Work& work) {
        run_blocks(n, block_size, work);
    }

    template <class Work>
    void launch_counted(const char* label, const std::uint32_t* count, std::uint32_t limit,
                        const Work& work) {
        launch(label, std::min(*count, limit), work);
    }

    /// A warp of the host is one element: its lanes are in step, warps are not.
    template <class Work>
    void launch_warps(const char* label, const std::uint32_t* count, std::uint32_t limit,
                      const Work& work) {
        launch_tiles(label, warps_for(std::min(*count, limit)), work);
    }

    template <class Work>
    void launch_tiles(const char*, std::uint32_t n, const Work& work) {
        run_blocks(n, block_size / warp_lanes, [&](std::uint32_t t) { work(HostWarp(), t); });
    }

    void exclusive_scan(const char* label, std::uint32_t* values, std::uint32_t n,
                        std::uint32_t* total) {
        host_.exclusive_scan(label, values, n, total);
    }

    void exclusive_scan_counted(const char* label, std::uint32_t* values,
                                const std::uint32_t* count, std::uint32_t limit) {
        host_.exclusive_scan_counted(label, values, count, limit);
    }

    void exclusive_scan_wide(const char* label, std::uint64_t* values, std::uint32_t n) {
        host_.exclusive_scan_wide(label, values, n);
    }

    /// As on a GPU, the places behind the last pair do not keep what they held.
    template <class Key>
    void sort_pairs(const char* label, const SortArrays<Key>& arrays, std::uint32_t limit,
                    const std::uint32_t* count, int key_bits) {
        host_.sort_pairs(label, arrays, limit, count, key_bits);
        const std::uint32_t n = count == nullptr ? limit : std::min(*count, limit);
        std::fill(arrays.sorted_keys + n, arrays.sorted_keys + limit, static_cast<Key>(random_()));
        std::fill(arrays.keys, arrays.keys + limit, static_cast<Key>(random_()));
    }

    /// A GPU's host knows nothing either.
    [[nodiscard]] bool maybe_any(const std::uint32_t*) const { return true; }

private:
    static std::vector<std::uint32_t> shuffled(std::uint32_t n, std::uint64_t seed) {
        std::vector<std::uint32_t> order(n);
        std::iota(order.begin(), order.end(), 0u);
        std::mt19937_64 random(seed);
        std::ranges::shuffle(order, random);
        return order;
    }

    /// Each thread has its share of the blocks, however late it comes: what is wrong between blocks
    /// is wrong between threads, where the thread sanitizer sees it.
    template <class Work>
    void run_blocks(std::uint32_t n, std::uint32_t size, const Work& work) {
        if (n == 0) return;
        const std::uint64_t launch_seed = random_();
        const std::vector<std::uint32_t> blocks = shuffled((n - 1) / size + 1, launch_seed);
        const std::size_t threads = std::min(blocks.size(), static_cast<std::size_t>(threads_));
        std::atomic<std::size_t> next_thread{0};
        crew_.run(threads - 1, [&] {
            std::size_t k = next_thread.fetch_add(1, std::memory_order_relaxed);
            for (; k < blocks.size(); k += threads) {
                const std::uint32_t begin = blocks[k] * size;
                run_block(begin, std::min(size, n - begin), launch_seed + blocks[k], work);
            }
        });
    }

    template <class Work>
    static void run_block(std::uint32_t begin, std::uint32_t size, std::uint64_t seed,
                          const Work& work) {
        for (const std::uint32_t k : shuffled(size, seed)) work(begin + k);
    }

    std::mt19937_64 random_;
    int threads_;
    HostLauncher<> host_;
    Crew crew_;
};

}  // namespace raydix::test
