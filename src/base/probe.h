// What a launch reports of its own work, for the scaling study of the builders. Functors that the
// study counts take a probe as a template parameter; in every real build it is NoProbe and costs
// nothing.
#pragma once

#include <cstdint>

#include "base/hd.h"

namespace raydix {

struct NoProbe {
    static constexpr bool counts = false;
    /// Memory read or written, in bytes, each access counted.
    RAYDIX_HD static void bytes(std::uint64_t) {}
    /// One more access that had to wait for the one before.
    RAYDIX_HD static void step() {}
    RAYDIX_HD static void steps(std::uint64_t) {}
    /// A chain of `length` accesses through several work items that wait for each other.
    RAYDIX_HD static void chain(std::uint32_t /*length*/) {}
};

/// The work of the items that one thread ran, since it was last reset. Host only.
struct WorkCount {
    std::uint64_t bytes = 0;
    std::uint32_t steps = 0;          // of the item at work
    std::uint32_t longest_chain = 0;  // of all items
};

struct CountProbe {
    static constexpr bool counts = true;
    static WorkCount& work() {
        thread_local WorkCount count;
        return count;
    }
    static void bytes(std::uint64_t n) { work().bytes += n; }
    static void step() { ++work().steps; }
    static void steps(std::uint64_t n) { work().steps += static_cast<std::uint32_t>(n); }
    static void chain(std::uint32_t length) {
        if (length > work().longest_chain) work().longest_chain = length;
    }
};

}  // namespace raydix
