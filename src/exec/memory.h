// How many bytes the library's arrays hold now, and held at most.
#pragma once

#include <atomic>
#include <cstdint>

namespace raydix {

class MemoryCount {
public:
    void take(std::uint64_t bytes) {
        const std::uint64_t now = now_.fetch_add(bytes, std::memory_order_relaxed) + bytes;
        std::uint64_t peak = peak_.load(std::memory_order_relaxed);
        while (now > peak && !peak_.compare_exchange_weak(peak, now, std::memory_order_relaxed)) {
        }
    }
    void give_back(std::uint64_t bytes) { now_.fetch_sub(bytes, std::memory_order_relaxed); }

    [[nodiscard]] std::uint64_t now() const { return now_.load(std::memory_order_relaxed); }
    [[nodiscard]] std::uint64_t peak() const { return peak_.load(std::memory_order_relaxed); }
    /// Starts a new peak from what is held now.
    void restart_peak() { peak_.store(now(), std::memory_order_relaxed); }

private:
    std::atomic<std::uint64_t> now_{0};
    std::atomic<std::uint64_t> peak_{0};
};

MemoryCount& memory_count();

}  // namespace raydix
