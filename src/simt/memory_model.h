// What the reads and writes of a warp ask of memory, from their real addresses: fetches of texture
// units, requests to a first-level cache, and the lines and sectors that go on to the caches
// (memory_replay.h).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "simt/memory_replay.h"
#include "simt/simulated_warp.h"

namespace raydix {

/// An array that kernels read or write.
struct MemoryRange {
    const void* begin;
    std::uint64_t bytes;
    enum class Holds { nodes, triangles, other } holds = Holds::other;
};

class MemoryModel final : public MemoryObserver {
public:
    /// `ranges`: all that will be touched, stacks aside. They follow each other in the model's own
    /// address space, so that figures do not depend on where the host put them.
    MemoryModel(const MachineModel& machine, std::uint32_t width, std::uint32_t stack_entries,
                std::span<const MemoryRange> ranges);

    /// Stacks of rays that go from lane to lane. Such a kernel has no others.
    void add_stacks(const void* begin, std::uint64_t bytes);

    /// What was observed since the last call was one warp's, on this multiprocessor.
    void hand_over(std::uint32_t multiprocessor);
    void finish() { replay_.finish(); }

    void access(const void* const* addresses, std::uint32_t lanes, std::uint32_t bytes,
                Access how) override;
    void stack(const std::int32_t* entries, std::uint32_t lanes, Access how) override;

    [[nodiscard]] const MemoryTraffic& traffic() const { return replay_.traffic; }

private:
    struct Range {
        std::uintptr_t begin, end;
        std::uint64_t at;  // in the model's address space
        bool texture;
    };
    [[nodiscard]] const Range& range_of(const void* address) const;
    [[nodiscard]] std::uint64_t set_out(std::span<const MemoryRange> ranges);
    /// Requests for the `bytes` at each of `places`, at most 16 a lane at once.
    void count_requests(std::uint32_t lanes, std::uint32_t bytes);
    void add_units(std::uint32_t lanes, std::uint32_t bytes, MemoryUnit unit);

    const MachineModel& machine_;
    std::uint32_t width_;
    std::vector<Range> ranges_;
    std::vector<std::uint64_t> places_;   // [width]: of lanes, or `nowhere`
    std::vector<std::uint64_t> numbers_;  // of the lines or sectors of one access
    MemoryTrace trace_;
    MemoryReplay replay_;
};

}  // namespace raydix
