// Lets a builder that takes the number of keys from the host run where only the device knows it,
// because primitives that are left out were found on the way. The host gives the capacity; every
// functor that holds the number of keys gets the exact one when it runs, and launches with an item
// per key run that many.
#pragma once

#include <cstdint>

#include "base/hd.h"
#include "exec/host_launcher.h"  // SortArrays

namespace raydix {

template <class Work>
inline constexpr bool has_key_count = requires(Work& w) {
    w.keys.count;
}
|| requires(Work& w) { w.keys.keys.count; }
|| requires(Work& w) { w.key_count; };
template <class Work>
inline constexpr bool has_keys = requires(Work& w) {
    w.keys.count;
}
|| requires(Work& w) { w.keys.keys.count; };

template <class Work>
struct WithExactCount {
    Work work;
    const std::uint32_t* exact;
    RAYDIX_HD void operator()(std::uint32_t i) const {
        Work mine = work;
        if constexpr (requires(Work & w) { w.keys.count; })
            mine.keys.count = *exact;
        else if constexpr (requires(Work & w) { w.keys.keys.count; })
            mine.keys.keys.count = *exact;
        if constexpr (requires(Work & w) { w.key_count; }) mine.key_count = *exact;
        mine(i);
    }
};

/// The exact number of keys and what follows from it, where the device can read it.
struct KeyCounts {
    std::uint32_t exact;   // keys that count
    std::uint32_t pairs;   // exact - 1, or 0
    std::uint32_t unused;  // capacity - exact
};

struct SetKeyCounts {
    const std::uint32_t* exact;
    std::uint32_t capacity;
    KeyCounts* counts;
    RAYDIX_HD void operator()(std::uint32_t) const {
        *counts = {*exact, *exact > 0 ? *exact - 1 : 0, capacity - *exact};
    }
};

struct ClearBehind {
    std::uint32_t* values;
    const std::uint32_t* exact;
    RAYDIX_HD void operator()(std::uint32_t i) const { values[*exact + i] = 0; }
};

/// A launcher in front of another: see above. Scans of an array with a value per key see zeros
/// behind the last key that counts.
template <class Launcher>
class CountedKeys {
public:
    using Probe = typename Launcher::Probe;

    /// `counts` [1]: written by SetKeyCounts before.
    CountedKeys(Launcher& launcher, std::uint32_t capacity, const KeyCounts* counts)
        : launcher_(launcher), capacity_(capacity), counts_(counts) {}

    template <class Work>
    void launch(const char* label, std::uint32_t n, const Work& work) {
        if constexpr (has_keys<Work>) {
            launcher_.launch_counted(label, n == capacity_ ? exact() : pairs(), n, patched(work));
        } else {
            launcher_.launch(label, n, patched(work));
        }
    }
    template <class Work>
    void launch_counted(const char* label, const std::uint32_t* count, std::uint32_t limit,
                        const Work& work) {
        launcher_.launch_counted(label, count, limit, patched(work));
    }
    void exclusive_scan(const char* label, std::uint32_t* values, std::uint32_t n,
                        std::uint32_t* total) {
        launcher_.launch_counted("keys.clear_unused", unused(), n, ClearBehind{values, exact()});
        launcher_.exclusive_scan(label, values, n, total);
    }
    void exclusive_scan_counted(const char* label, std::uint32_t* values,
                                const std::uint32_t* count, std::uint32_t limit) {
        launcher_.exclusive_scan_counted(label, values, count, limit);
    }
    template <class Key>
    void sort_pairs(const char* label, const SortArrays<Key>& arrays, std::uint32_t limit,
                    const std::uint32_t* count, int key_bits) {
        launcher_.sort_pairs(label, arrays, limit, count, key_bits);
    }
    [[nodiscard]] bool maybe_any(const std::uint32_t* count) const {
        return launcher_.maybe_any(count);
    }

    // Addresses only: the host may not read what they point to.
    [[nodiscard]] const std::uint32_t* exact() const { return word(0); }
    [[nodiscard]] const std::uint32_t* pairs() const { return word(1); }
    [[nodiscard]] const std::uint32_t* unused() const { return word(2); }

private:
    template <class Work>
    auto patched(const Work& work) const {
        if constexpr (has_key_count<Work>)
            return WithExactCount<Work>{work, exact()};
        else
            return work;
    }
    [[nodiscard]] const std::uint32_t* word(std::size_t k) const {
        return counts_ == nullptr ? nullptr : reinterpret_cast<const std::uint32_t*>(counts_) + k;
    }

    Launcher& launcher_;
    std::uint32_t capacity_;
    const KeyCounts* counts_;
};

}  // namespace raydix
