// A stream of little-endian 32-bit words -> XXH3-128 as hex: what the hashes of all trees are made
// of.
#pragma once

#include <fmt/format.h>
#include <raydix/types.h>
#include <xxhash.h>

#include <array>
#include <bit>
#include <cstdint>
#include <new>
#include <string>

namespace raydix {

/// Collects words and hands them on in large pieces; the bytes are the same on every machine.
class WordHash {
public:
    WordHash() : state_(XXH3_createState()) {
        if (!state_) throw std::bad_alloc();
        XXH3_128bits_reset(state_);
    }
    ~WordHash() { XXH3_freeState(state_); }
    WordHash(const WordHash&) = delete;
    WordHash& operator=(const WordHash&) = delete;

    void put(std::uint32_t word) {
        if (used_ == buffer_.size()) flush();
        for (int shift = 0; shift < 32; shift += 8)
            buffer_[used_++] = static_cast<unsigned char>(word >> shift);
    }
    void put(Vec3 p) {
        for (const float x : {p.x, p.y, p.z}) put(std::bit_cast<std::uint32_t>(x));
    }
    [[nodiscard]] std::string hex() {
        flush();
        const XXH128_hash_t hash = XXH3_128bits_digest(state_);
        return fmt::format("{:016x}{:016x}", hash.high64, hash.low64);
    }

private:
    void flush() {
        XXH3_128bits_update(state_, buffer_.data(), used_);
        used_ = 0;
    }

    XXH3_state_t* state_;
    std::array<unsigned char, 1 << 14> buffer_;  // whole words; stays in the first cache
    std::size_t used_ = 0;
};

}  // namespace raydix
