// Addresses of a warp -> sectors -> traffic of each level.
#include "simt/memory_model.h"

#include <algorithm>
#include <stdexcept>

namespace raydix {
namespace {
constexpr std::uint64_t sector_bytes = 32, line_bytes = 128, chunk_bytes = 16;
}

SectorCache::SectorCache(std::uint64_t bytes)
    : sets_(std::max<std::uint64_t>(1, bytes / sector_bytes / ways)), entries_(sets_ * ways) {}

bool SectorCache::touch(std::uint64_t number) {
    Way* set = &entries_[number % sets_ * ways];
    Way* oldest = set;
    ++clock_;
    for (Way* way = set; way != set + ways; ++way) {
        if (way->number == number) {
            way->used = clock_;
            return true;
        }
        if (way->used < oldest->used) oldest = way;
    }
    *oldest = {number, clock_};
    return false;
}

MemoryModel::MemoryModel(std::uint32_t multiprocessors, std::uint64_t l1_bytes,
                         std::uint64_t l2_bytes, std::span<const MemoryRange> ranges)
    : l1_(multiprocessors, SectorCache(l1_bytes)), l2_(l2_bytes) {
    std::uint64_t at = 0;
    for (const MemoryRange& range : ranges) {
        const auto begin = reinterpret_cast<std::uintptr_t>(range.begin);
        ranges_.push_back({begin, begin + range.bytes, at});
        at += (range.bytes + line_bytes - 1) / line_bytes * line_bytes;
    }
}

std::uint64_t MemoryModel::place_of(const void* address) const {
    const auto place = reinterpret_cast<std::uintptr_t>(address);
    for (const Range& range : ranges_)
        if (place >= range.begin && place < range.end) return place - range.begin + range.at;
    throw std::logic_error("the memory model does not know an address that a kernel reads");
}

void MemoryModel::read(const void* const* addresses, int count, std::uint32_t bytes) {
    const auto distinct = [&](std::uint64_t unit) {
        numbers_.clear();
        for (int k = 0; k < count; ++k) {
            const std::uint64_t first = place_of(addresses[k]);
            for (std::uint64_t n = first / unit; n <= (first + bytes - 1) / unit; ++n)
                numbers_.push_back(n);
        }
        std::sort(numbers_.begin(), numbers_.end());
        numbers_.erase(std::unique(numbers_.begin(), numbers_.end()), numbers_.end());
    };
    distinct(line_bytes);
    l1_transactions_ += numbers_.size() * ((bytes + chunk_bytes - 1) / chunk_bytes);
    distinct(sector_bytes);
    for (const std::uint64_t sector : numbers_) {
        if (l1_[place_].touch(sector)) continue;
        l2_bytes_ += sector_bytes;
        if (!l2_.touch(sector)) dram_bytes_ += sector_bytes;
    }
}

}  // namespace raydix
