// tree_hash: nodes in preorder, as a stream of little-endian 32-bit words -> XXH3-128 as hex.
#include <fmt/format.h>
#include <xxhash.h>

#include <array>
#include <bit>
#include <new>

#include "tree/walk.h"

namespace raydix {
namespace {

constexpr std::uint32_t tree_kind_bvh = 0;

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

}  // namespace

std::string tree_hash(const Bvh& bvh) {
    WordHash hash;
    hash.put(tree_kind_bvh);
    hash.put(static_cast<std::uint32_t>(bvh.options().bits));
    hash.put(static_cast<std::uint32_t>(bvh.options().max_leaf));
    walk_preorder(bvh.nodes(), bvh.max_depth(), [&](std::uint32_t node_index) {
        const BvhNode& node = bvh.nodes()[node_index];
        hash.put(node.lo);
        hash.put(node.hi);
        if (!node.is_leaf()) return;
        hash.put(node.count);
        for (const std::uint32_t primitive_id : bvh.order().subspan(node.first, node.count))
            hash.put(primitive_id);
    });
    return hash.hex();
}

}  // namespace raydix
