// Accesses of warps -> caches -> traffic and waiting. The warps in flight on a multiprocessor take
// turns, an access each, so that they share its caches as they would.
#pragma once

#include <raydix/simulate.h>

#include <cstdint>
#include <vector>

namespace raydix {

/// Least recently used, 8 ways, of units of equal size.
class SetCache {
public:
    SetCache(std::uint64_t bytes, std::uint64_t unit_bytes);

    struct Touch {
        bool hit;
        bool wrote_back;  // a unit that had been written made room
    };
    /// Unit `number` is there after.
    Touch touch(std::uint64_t number, bool write = false);

private:
    static constexpr std::uint64_t ways = 8;
    std::uint64_t sets_;
    std::uint64_t clock_ = 0;
    struct Way {
        std::uint64_t number = ~std::uint64_t{0};
        std::uint64_t used = 0;
        bool written = false;
    };
    std::vector<Way> entries_;
};

/// Sums over a launch.
struct MemoryTraffic {
    std::uint64_t texture_fetches = 0;  // of up to 16 bytes, by single lanes
    std::uint64_t l1_requests = 0;      // of a line each
    std::uint64_t replays = 0;          // of these, beyond the first line of a request
    std::uint64_t l2_bytes = 0, dram_bytes = 0;
    double wait_clocks = 0;  // of all warps
};

/// One line or sector that an access touches.
struct MemoryUnit {
    std::uint32_t sector : 27;  // of 32 bytes; of a stack: within those of its warp
    std::uint32_t texture : 1;
    std::uint32_t stack : 1;
    std::uint32_t write : 1;
    std::uint32_t waits : 1;  // the warp needs the value to go on
    std::uint32_t last : 1;   // of its access
};
using MemoryTrace = std::vector<MemoryUnit>;

inline constexpr std::uint64_t sector_bytes = 32;

class MemoryReplay {
public:
    /// `warps`: in flight on a multiprocessor. Stacks begin at sector `stacks_at`.
    MemoryReplay(const MachineModel& machine, std::uint32_t warps, std::uint64_t stacks_at,
                 std::uint64_t stack_sectors);

    /// A warp begins on a multiprocessor; where all places are taken, others go on until one ends.
    void start(std::uint32_t multiprocessor, MemoryTrace trace);
    /// All warps to their ends.
    void finish();

    MemoryTraffic traffic;

private:
    struct Warp {
        MemoryTrace trace;
        std::uint32_t place;  // of its stack
        std::size_t next = 0;
    };
    struct Multiprocessor {
        std::vector<Warp> running;
        std::vector<std::uint32_t> free_places;
        std::size_t turn = 0;
    };
    void take_turn(std::uint32_t multiprocessor);
    /// Clocks until the value is there.
    [[nodiscard]] double touch(std::uint32_t multiprocessor, std::uint32_t place, MemoryUnit unit);
    [[nodiscard]] double touch_data(std::uint32_t multiprocessor, std::uint64_t sector,
                                    MemoryUnit unit);
    [[nodiscard]] double touch_second(std::uint64_t sector, std::uint64_t sectors, bool write);

    const MachineModel& machine_;
    std::uint64_t warps_, stacks_at_, stack_sectors_;
    std::vector<SetCache> texture_, l1_;
    SetCache l2_;
    std::vector<Multiprocessor> multiprocessors_;
};

}  // namespace raydix
