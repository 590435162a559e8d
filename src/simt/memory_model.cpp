#include "simt/memory_model.h"

#include <raydix/error.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

namespace raydix {
namespace {

constexpr std::uint64_t nowhere = ~std::uint64_t{0};
constexpr std::uint64_t align_bytes = 256;
// One request serves as many lanes as it takes to ask for 128 bytes: a quarter of a warp for words
// of 16 bytes, all of it for words of 4 (CUDA C Programming Guide 4.2, F.4.2).
constexpr std::uint32_t request_bytes = 128, word_bytes = 16;

std::uint64_t rounded(std::uint64_t bytes) {
    return (bytes + align_bytes - 1) / align_bytes * align_bytes;
}

void check_bytes(std::uint64_t bytes) {
    if (bytes / sector_bytes >= 1u << 27)
        throw InputError(
            "the memory model takes less than 4 GiB of tree, rays, hits and stacks; these are " +
            std::to_string(bytes) + " bytes");
}

}  // namespace

std::uint64_t MemoryModel::set_out(std::span<const MemoryRange> ranges) {
    std::uint64_t at = 0;
    for (const MemoryRange& range : ranges) {
        const auto begin = reinterpret_cast<std::uintptr_t>(range.begin);
        const bool texture =
            machine_.texture_bytes > 0 &&
            (range.holds == MemoryRange::Holds::triangles ||
             (range.holds == MemoryRange::Holds::nodes && machine_.nodes_by_texture));
        ranges_.push_back({begin, begin + range.bytes, at, texture});
        at += rounded(range.bytes);
    }
    check_bytes(at);
    return at / sector_bytes;
}

void MemoryModel::add_stacks(const void* begin, std::uint64_t bytes) {
    const std::uint64_t at =
        ranges_.empty() ? 0
                        : ranges_.back().at + rounded(ranges_.back().end - ranges_.back().begin);
    check_bytes(at + rounded(bytes));
    const auto first = reinterpret_cast<std::uintptr_t>(begin);
    ranges_.push_back({first, first + bytes, at, false});
}

MemoryModel::MemoryModel(const MachineModel& machine, std::uint32_t width,
                         std::uint32_t stack_entries, std::span<const MemoryRange> ranges)
    : machine_(machine),
      width_(width),
      places_(width),
      replay_(machine, std::max(1u, machine.resident_lanes / width), set_out(ranges),
              rounded(std::uint64_t{stack_entries} * width * 4) / sector_bytes) {}

void MemoryModel::hand_over(std::uint32_t multiprocessor) {
    replay_.start(multiprocessor, std::exchange(trace_, {}));
}

const MemoryModel::Range& MemoryModel::range_of(const void* address) const {
    const auto place = reinterpret_cast<std::uintptr_t>(address);
    for (const Range& range : ranges_)
        if (place >= range.begin && place < range.end) return range;
    throw std::logic_error("the memory model does not know an address that a kernel touches");
}

void MemoryModel::access(const void* const* addresses, std::uint32_t lanes, std::uint32_t bytes,
                         Access how) {
    const Range* range = nullptr;
    std::uint32_t active = 0;
    for (std::uint32_t k = 0; k < lanes; ++k) {
        places_[k] = nowhere;
        if (addresses[k] == nullptr) continue;
        const auto place = reinterpret_cast<std::uintptr_t>(addresses[k]);
        if (range == nullptr || place < range->begin || place >= range->end)
            range = &range_of(addresses[k]);
        places_[k] = place - range->begin + range->at;
        ++active;
    }
    if (active == 0) return;
    if (range->texture)
        replay_.traffic.texture_fetches += active * ((bytes + word_bytes - 1) / word_bytes);
    else
        count_requests(lanes, bytes);
    add_units(lanes, bytes, {0, range->texture, 0, how == Access::write, how == Access::read, 0});
}

void MemoryModel::stack(const std::int32_t* entries, std::uint32_t lanes, Access how) {
    // Entries of one height lie beside each other, a lane each.
    bool any = false;
    for (std::uint32_t k = 0; k < lanes; ++k) {
        places_[k] =
            entries[k] < 0 ? nowhere : (static_cast<std::uint64_t>(entries[k]) * width_ + k) * 4;
        any = any || entries[k] >= 0;
    }
    if (!any) return;
    count_requests(lanes, 4);
    add_units(lanes, 4, {0, 0, 1, how == Access::write, how == Access::read, 0});
}

void MemoryModel::count_requests(std::uint32_t lanes, std::uint32_t bytes) {
    const std::uint32_t word = std::min(bytes, word_bytes), together = request_bytes / word;
    const std::uint32_t line_bytes = std::min(machine_.l1_line_bytes, request_bytes);
    const std::uint64_t at_once = request_bytes / line_bytes;  // lines of one transaction
    for (std::uint32_t offset = 0; offset < bytes; offset += word)
        for (std::uint32_t first = 0; first < lanes; first += together) {
            numbers_.clear();
            for (std::uint32_t k = first; k < std::min(lanes, first + together); ++k) {
                if (places_[k] == nowhere) continue;
                const std::uint64_t line = (places_[k] + offset) / line_bytes;
                if (std::find(numbers_.begin(), numbers_.end(), line) == numbers_.end())
                    numbers_.push_back(line);
            }
            const std::uint64_t requests = (numbers_.size() + at_once - 1) / at_once;
            replay_.traffic.l1_requests += requests;
            if (requests > 0) replay_.traffic.replays += requests - 1;
        }
}

void MemoryModel::add_units(std::uint32_t lanes, std::uint32_t bytes, MemoryUnit unit) {
    // Lines where a whole line is brought, else sectors.
    const bool lines = !unit.texture && machine_.l1_bytes > 0 && !(unit.write && !unit.stack);
    const std::uint64_t size = lines ? machine_.l1_line_bytes : sector_bytes;
    numbers_.clear();
    for (std::uint32_t k = 0; k < lanes; ++k) {
        if (places_[k] == nowhere) continue;
        for (std::uint64_t n = places_[k] / size; n <= (places_[k] + bytes - 1) / size; ++n)
            if (numbers_.empty() || numbers_.back() != n) numbers_.push_back(n);
    }
    std::sort(numbers_.begin(), numbers_.end());
    numbers_.erase(std::unique(numbers_.begin(), numbers_.end()), numbers_.end());
    for (const std::uint64_t number : numbers_) {
        unit.sector = static_cast<std::uint32_t>(number * (size / sector_bytes)) & 0x7FFFFFFu;
        trace_.push_back(unit);
    }
    trace_.back().last = 1;
}

}  // namespace raydix
