// Where the triangles of leaves go: into blocks of four, no leaf over the end of one.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

namespace raydix {

/// Triangles of a block: what one vector instruction of every processor takes, and a leaf at most.
inline constexpr std::uint32_t block_lanes = 4;

/// Puts each leaf into the open block with the least room that is enough. Of two open blocks with
/// the same room the older one is closed.
class BlockFiller {
public:
    static constexpr std::uint32_t lanes = block_lanes;

    /// The place of the first of `count` triangles, 1 to 4: lane place % 4 of block place / 4. Lane
    /// 0 is the first one that a block gives.
    std::uint32_t place(std::uint32_t count) {
        const std::uint32_t enough = open_ >> count;
        std::uint32_t first = lanes * blocks_, room = lanes;
        if (enough != 0) {
            room = count + static_cast<std::uint32_t>(std::countr_zero(enough));
            first = next_[room];
            open_ &= ~(1u << room);
        } else {
            ++blocks_;
        }
        const std::uint32_t left = room - count;
        next_[left] = first + count;
        open_ |= 1u << left & ~1u;
        return first;
    }
    [[nodiscard]] std::uint32_t blocks() const { return blocks_; }

private:
    std::array<std::uint32_t, lanes> next_{};  // [room]: the next place of the open block
    std::uint32_t open_ = 0;                   // bit r: there is an open block with room for r
    std::uint32_t blocks_ = 0;
};

}  // namespace raydix
