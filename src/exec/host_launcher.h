// Runs a builder's launches on the CPU, one parallel loop each. A builder written against a
// launcher is one text for all backends:
//
//   launch(label, n, work)      work(i) for i in [0, n), any order
//   launch_counted(label, count, limit, work)
//                               the same for i in [0, *count), *count <= limit, written by an
//                               earlier launch: the host of a GPU does not know it
//   launch_warps(label, count, limit, work)
//                               work(warp, w) for w in [0, *count / 32), rounded up: 32 lanes that
//                               work together (exec/warp.h); *count <= limit
//   launch_tiles(label, n, work)
//                               work(warp, t) for t in [0, n): 32 lanes for each
//   exclusive_scan(label, values, n, total)
//                               each value becomes the sum of those before it; *total, if not
//                               null, the sum of all
//   exclusive_scan_counted(label, values, count, limit)
//                               the same for the first *count <= limit values; the sum of all
//                               goes behind them, to values[*count]
//   exclusive_scan_wide(label, values, n)
//                               the same for values of 64 bits, without their sum
//   sort_pairs(label, arrays, limit, count, key_bits)
//                               the first *count pairs by key, stable; all `limit` if count is
//                               null
//   maybe_any(count)            false if *count is known to be 0; a GPU's host knows nothing
//   Probe                       what counted functors report to (base/probe.h)
//
// All pointers are to the launcher's memory. Launches see the results of the launches before them.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "base/probe.h"
#include "exec/launch_clock.h"
#include "exec/parallel.h"
#include "exec/scan.h"
#include "exec/warp.h"

namespace raydix {

/// One launch as it ran. `longest_chain`: accesses of an item that wait for each other, at most;
/// `steps`: those of all items. Bytes, chain and steps are known to CountProbe, the time is that of
/// the machine it ran on.
struct LaunchRecord {
    std::string label;
    std::uint64_t items = 0, bytes = 0;
    std::uint32_t longest_chain = 0;
    std::uint64_t steps = 0;
    double ms = 0;
};

/// Pairs to sort and where they go; `keys` and `values` are lost.
template <class Key>
struct SortArrays {
    Key* keys;
    std::uint32_t* values;
    Key* sorted_keys;
    std::uint32_t* sorted_values;
};

template <class Probe_ = NoProbe>
class HostLauncher {
public:
    using Probe = Probe_;

    /// `log`: where launches are written down; may be null. With one thread their times are its
    /// processor time, which other programs do not lengthen; else those of the clock on the wall.
    explicit HostLauncher(std::vector<LaunchRecord>* log = nullptr)
        : log_(log), one_thread_(log != nullptr && thread_count() == 1) {}

    template <class Work>
    void launch(const char* label, std::uint32_t n, const Work& work) {
        const double start = now();
        LaunchRecord record{label, n};
        if constexpr (Probe::counts) {
            run_counted(record, n, work);
        } else {
            for_each_index(
                n, [&](std::size_t i) { work(static_cast<std::uint32_t>(i)); }, grain);
        }
        note(std::move(record), start);
    }

    template <class Work>
    void launch_counted(const char* label, const std::uint32_t* count, std::uint32_t limit,
                        const Work& work) {
        launch(label, std::min(*count, limit), work);
    }

    template <class Work>
    void launch_warps(const char* label, const std::uint32_t* count, std::uint32_t limit,
                      const Work& work) {
        const double start = now();
        const std::uint32_t warps = warps_for(std::min(*count, limit));
        for_each_index(
            warps, [&](std::size_t w) { work(HostWarp(), static_cast<std::uint32_t>(w)); },
            grain / 16);
        note({label, std::uint64_t{warps} * warp_lanes}, start);
    }

    template <class Work>
    void launch_tiles(const char* label, std::uint32_t n, const Work& work) {
        launch(label, n, [&](std::uint32_t t) { work(HostWarp(), t); });
    }

    void exclusive_scan(const char* label, std::uint32_t* values, std::uint32_t n,
                        std::uint32_t* total) {
        const std::uint32_t sum = scan(label, std::span<std::uint32_t>(values, n));
        if (total != nullptr) *total = sum;
    }

    void exclusive_scan_counted(const char* label, std::uint32_t* values,
                                const std::uint32_t* count, std::uint32_t limit) {
        const std::uint32_t n = std::min(*count, limit);
        exclusive_scan(label, values, n, values + n);
    }

    void exclusive_scan_wide(const char* label, std::uint64_t* values, std::uint32_t n) {
        static_cast<void>(scan(label, std::span<std::uint64_t>(values, n)));
    }

    template <class Key>
    void sort_pairs(const char* label, const SortArrays<Key>& arrays, std::uint32_t limit,
                    const std::uint32_t* count, int key_bits);

    [[nodiscard]] bool maybe_any(const std::uint32_t* count) const { return *count != 0; }

    /// What runs on this processor alone, written down as one launch of which only the time and the
    /// items are known.
    template <class Body>
    void run_whole(const char* label, std::uint64_t items, const Body& body) {
        const double start = now();
        body();
        note({label, items}, start);
    }

private:
    static constexpr std::size_t grain = 1024;

    [[nodiscard]] double now() const {
        return log_ == nullptr ? 0 : one_thread_ ? thread_time_ms() : wall_time_ms();
    }
    void note(LaunchRecord record, double start) {
        if (log_ == nullptr) return;
        record.ms = now() - start;
        log_->push_back(std::move(record));
    }

    /// Rows of neighbours that one thread takes in order: body(b, begin, end) for each block. Items
    /// are the neighbours, because a GPU's block has a thread for each; the chain is what one of
    /// them waits for.
    template <class Body>
    void launch_blocks(const char* label, const char* pass, std::size_t n, std::size_t block,
                       const Body& body) {
        const double start = now();
        LaunchRecord record{log_ == nullptr ? std::string() : std::string(label) + pass, n};
        if constexpr (Probe::counts) {
            std::atomic<std::uint64_t> bytes{0}, steps{0};
            for_each_block(n, block, [&](std::size_t b, std::size_t begin, std::size_t end) {
                Probe::work() = {};
                body(b, begin, end);
                bytes += Probe::work().bytes;
                steps += Probe::work().steps;
            });
            record.bytes = bytes;
            record.steps = steps;
            record.longest_chain = static_cast<std::uint32_t>(n == 0 ? 0 : (steps + n - 1) / n);
        } else {
            for_each_block(n, block, body);
        }
        note(std::move(record), start);
    }

    template <class T>
    T scan(const char* label, std::span<T> values) {
        return detail::scan_blocks<Probe>(
            values, [&](const char* pass, std::size_t n, std::size_t block, const auto& body) {
                launch_blocks(label, pass, n, block, body);
            });
    }

    template <class Work>
    void run_counted(LaunchRecord& record, std::uint32_t n, const Work& work) {
        std::atomic<std::uint64_t> bytes{0}, steps{0};
        std::atomic<std::uint32_t> longest{0};
        for_each_range(n, grain, [&](std::size_t begin, std::size_t end) {
            WorkCount& mine = Probe::work();
            mine = {};
            std::uint64_t all_steps = 0;
            for (std::size_t i = begin; i < end; ++i) {
                mine.steps = 0;
                work(static_cast<std::uint32_t>(i));
                all_steps += mine.steps;
                mine.longest_chain = std::max(mine.longest_chain, mine.steps);
            }
            bytes += mine.bytes;
            steps += all_steps;
            std::uint32_t seen = longest.load();
            while (seen < mine.longest_chain &&
                   !longest.compare_exchange_weak(seen, mine.longest_chain)) {
            }
        });
        record.bytes = bytes;
        record.steps = steps;
        record.longest_chain = longest;
    }

    std::vector<LaunchRecord>* log_;
    bool one_thread_;
};

/// Stable least-significant-digit counting sort, eight bits a pass. Each pass counts the digits of
/// blocks, sums the counts up, and moves the pairs. A block's counters stay in its cache (or a
/// GPU's shared memory): the bytes are those of keys and values.
template <class Probe_>
template <class Key>
void HostLauncher<Probe_>::sort_pairs(const char* label, const SortArrays<Key>& a,
                                      std::uint32_t limit, const std::uint32_t* count,
                                      int key_bits) {
    static_assert(std::is_unsigned_v<Key>);
    constexpr std::size_t digits = 256, block = 1u << 14;
    constexpr std::uint64_t pair_bytes = sizeof(Key) + sizeof(std::uint32_t);
    const std::uint32_t n = count == nullptr ? limit : std::min(*count, limit);
    const std::size_t blocks = (n + block - 1) / block;
    Key* from_keys = a.keys;
    Key* to_keys = a.sorted_keys;
    std::uint32_t* from_values = a.values;
    std::uint32_t* to_values = a.sorted_values;
    std::vector<std::uint32_t> starts(digits * blocks);
    const std::string starts_label = log_ == nullptr ? "" : std::string(label) + ".starts";
    for (int shift = 0; shift < key_bits; shift += 8) {
        const auto digit = [&](std::size_t i) {
            return static_cast<std::size_t>(from_keys[i] >> shift & (digits - 1));
        };
        launch_blocks(label, ".count", n, block,
                      [&](std::size_t b, std::size_t begin, std::size_t end) {
                          for (std::size_t d = 0; d < digits; ++d) starts[d * blocks + b] = 0;
                          for (std::size_t i = begin; i < end; ++i) ++starts[digit(i) * blocks + b];
                          Probe::bytes((end - begin) * sizeof(Key) + digits * sizeof(starts[0]));
                          Probe::steps(end - begin);
                      });
        scan(starts_label.c_str(), std::span<std::uint32_t>(starts));
        launch_blocks(label, ".move", n, block,
                      [&](std::size_t b, std::size_t begin, std::size_t end) {
                          for (std::size_t i = begin; i < end; ++i) {
                              const std::uint32_t at = starts[digit(i) * blocks + b]++;
                              to_keys[at] = from_keys[i];
                              to_values[at] = from_values[i];
                          }
                          Probe::bytes((end - begin) * 2 * pair_bytes);
                          Probe::steps(2 * (end - begin));
                      });
        std::swap(from_keys, to_keys);
        std::swap(from_values, to_values);
    }
    if (from_keys == a.sorted_keys) return;
    launch_blocks(label, ".copy", n, block, [&](std::size_t, std::size_t begin, std::size_t end) {
        std::copy(from_keys + begin, from_keys + end, a.sorted_keys + begin);
        std::copy(from_values + begin, from_values + end, a.sorted_values + begin);
        Probe::bytes((end - begin) * 2 * pair_bytes);
        Probe::steps(end - begin);
    });
}

}  // namespace raydix
