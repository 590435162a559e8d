#include "simt/memory_replay.h"

#include <algorithm>
#include <utility>

namespace raydix {

SetCache::SetCache(std::uint64_t bytes, std::uint64_t unit_bytes)
    : sets_(std::max<std::uint64_t>(1, bytes / unit_bytes / ways)), entries_(sets_ * ways) {}

SetCache::Touch SetCache::touch(std::uint64_t number, bool write) {
    Way* set = &entries_[number % sets_ * ways];
    Way* oldest = set;
    ++clock_;
    for (Way* way = set; way != set + ways; ++way) {
        if (way->number == number) {
            way->used = clock_;
            way->written |= write;
            return {true, false};
        }
        if (way->used < oldest->used) oldest = way;
    }
    const bool wrote_back = oldest->written;
    *oldest = {number, clock_, write};
    return {false, wrote_back};
}

MemoryReplay::MemoryReplay(const MachineModel& machine, std::uint32_t warps,
                           std::uint64_t stacks_at, std::uint64_t stack_sectors)
    : machine_(machine),
      warps_(warps),
      stacks_at_(stacks_at),
      stack_sectors_(stack_sectors),
      l2_(machine.l2_bytes, sector_bytes),
      multiprocessors_(machine.multiprocessors) {
    const std::uint64_t sharers = std::max(1u, machine.texture_sharers);
    if (machine.texture_bytes > 0)
        texture_.assign((machine.multiprocessors + sharers - 1) / sharers,
                        SetCache(machine.texture_bytes, sector_bytes));
    if (machine.l1_bytes > 0)
        l1_.assign(machine.multiprocessors, SetCache(machine.l1_bytes, machine.l1_line_bytes));
    for (Multiprocessor& part : multiprocessors_)
        for (std::uint32_t k = warps; k-- > 0;) part.free_places.push_back(k);
}

void MemoryReplay::start(std::uint32_t multiprocessor, MemoryTrace trace) {
    if (trace.empty()) return;
    Multiprocessor& part = multiprocessors_[multiprocessor];
    while (part.free_places.empty()) take_turn(multiprocessor);
    part.running.push_back({std::move(trace), part.free_places.back(), 0});
    part.free_places.pop_back();
}

void MemoryReplay::finish() {
    for (bool busy = true; busy;) {
        busy = false;
        for (std::uint32_t k = 0; k < multiprocessors_.size(); ++k) {
            // A round, so that multiprocessors go on together.
            for (std::size_t n = multiprocessors_[k].running.size(); n > 0; --n) take_turn(k);
            busy = busy || !multiprocessors_[k].running.empty();
        }
    }
}

void MemoryReplay::take_turn(std::uint32_t multiprocessor) {
    Multiprocessor& part = multiprocessors_[multiprocessor];
    if (part.running.empty()) return;
    if (part.turn >= part.running.size()) part.turn = 0;
    Warp& warp = part.running[part.turn];
    double clocks = 0;
    while (true) {
        const MemoryUnit unit = warp.trace[warp.next++];
        const double until = touch(multiprocessor, warp.place, unit);
        if (unit.waits) clocks = std::max(clocks, until);
        if (unit.last) break;
    }
    traffic.wait_clocks += clocks;
    if (warp.next < warp.trace.size()) {
        ++part.turn;
        return;
    }
    part.free_places.push_back(warp.place);
    if (part.turn + 1 < part.running.size()) warp = std::move(part.running.back());
    part.running.pop_back();
}

double MemoryReplay::touch(std::uint32_t multiprocessor, std::uint32_t place, MemoryUnit unit) {
    if (unit.texture) {
        SetCache& cache = texture_[multiprocessor / std::max(1u, machine_.texture_sharers)];
        if (cache.touch(unit.sector).hit) return machine_.texture_clocks;
        return touch_second(unit.sector, 1, false);
    }
    if (!unit.stack) return touch_data(multiprocessor, unit.sector, unit);
    const std::uint64_t warp = std::uint64_t{multiprocessor} * warps_ + place;
    return touch_data(multiprocessor, stacks_at_ + warp * stack_sectors_ + unit.sector, unit);
}

double MemoryReplay::touch_data(std::uint32_t multiprocessor, std::uint64_t sector,
                                MemoryUnit unit) {
    if (l1_.empty()) {  // no cache holds data; those of textures do not
        traffic.dram_bytes += sector_bytes;
        return machine_.dram_clocks;
    }
    // Results go through to the second cache. A stack's line is written back when it makes room.
    if (unit.write && !unit.stack) return touch_second(sector, 1, true);
    const std::uint64_t sectors = machine_.l1_line_bytes / sector_bytes;
    const SetCache::Touch found = l1_[multiprocessor].touch(sector / sectors, unit.write);
    if (found.wrote_back) traffic.l2_bytes += machine_.l1_line_bytes;
    if (found.hit) return machine_.l1_clocks;
    if (unit.write) return 0.0;  // not read before it is written
    return touch_second(sector / sectors * sectors, sectors, false);
}

double MemoryReplay::touch_second(std::uint64_t sector, std::uint64_t sectors, bool write) {
    double clocks = machine_.l2_clocks;
    for (std::uint64_t k = sector; k < sector + sectors; ++k) {
        traffic.l2_bytes += sector_bytes;
        const SetCache::Touch found = l2_.touch(k, write);
        if (found.wrote_back) traffic.dram_bytes += sector_bytes;
        if (found.hit || write) continue;
        traffic.dram_bytes += sector_bytes;
        clocks = machine_.dram_clocks;
    }
    return clocks;
}

}  // namespace raydix
