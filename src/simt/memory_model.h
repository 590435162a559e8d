// A first-order model of memory: real addresses through one small cache a multiprocessor and one
// large one, with the traffic of each counted. Latency and order of requests are left out.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "simt/simulated_warp.h"

namespace raydix {

/// Least recently used, 8 ways, by sectors of 32 bytes.
class SectorCache {
public:
    explicit SectorCache(std::uint64_t bytes);
    /// Whether sector `number` was there; it is after.
    bool touch(std::uint64_t number);

private:
    static constexpr std::uint64_t ways = 8;
    std::uint64_t sets_;
    std::uint64_t clock_ = 0;
    struct Way {
        std::uint64_t number = ~std::uint64_t{0};
        std::uint64_t used = 0;
    };
    std::vector<Way> entries_;
};

/// An array that kernels read.
struct MemoryRange {
    const void* begin;
    std::uint64_t bytes;
};

class MemoryModel final : public ReadObserver {
public:
    /// `ranges`: all that will be read. They follow each other in the model's own address space, so
    /// that figures do not depend on where the host put them.
    MemoryModel(std::uint32_t multiprocessors, std::uint64_t l1_bytes, std::uint64_t l2_bytes,
                std::span<const MemoryRange> ranges);

    void run_on(std::uint32_t multiprocessor) { place_ = multiprocessor; }
    void read(const void* const* addresses, int count, std::uint32_t bytes) override;

    /// One transaction: up to 16 bytes a lane, of one 128-byte line.
    [[nodiscard]] std::uint64_t l1_transactions() const { return l1_transactions_; }
    [[nodiscard]] std::uint64_t l2_bytes() const { return l2_bytes_; }
    [[nodiscard]] std::uint64_t dram_bytes() const { return dram_bytes_; }

private:
    [[nodiscard]] std::uint64_t place_of(const void* address) const;

    struct Range {
        std::uintptr_t begin, end;
        std::uint64_t at;  // in the model's address space
    };
    std::vector<Range> ranges_;
    std::vector<SectorCache> l1_;
    SectorCache l2_;
    std::uint32_t place_ = 0;
    std::vector<std::uint64_t> numbers_;
    std::uint64_t l1_transactions_ = 0, l2_bytes_ = 0, dram_bytes_ = 0;
};

}  // namespace raydix
