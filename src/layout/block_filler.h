// Where the triangles of leaves go: into blocks of four, no leaf over the end of one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace raydix {

/// Triangles of a block: what one vector instruction of every processor takes, and a leaf at most.
inline constexpr std::uint32_t block_lanes = 4;

/// Puts each leaf into the block that it fills best of a few that are not full.
class BlockFiller {
public:
    static constexpr std::uint32_t lanes = block_lanes;

    /// The place of the first of `count` triangles, 1 to 4: lane place % 4 of block place / 4.
    std::uint32_t place(std::uint32_t count) {
        std::size_t best = open_.size();
        for (std::size_t k = 0; k < open_.size(); ++k)
            if (room(open_[k]) >= count &&
                (best == open_.size() || room(open_[k]) < room(open_[best])))
                best = k;
        if (best == open_.size()) {
            // The fullest of those before makes way.
            best = 0;
            for (std::size_t k = 1; k < open_.size(); ++k)
                if (room(open_[k]) < room(open_[best])) best = k;
            open_[best] = lanes * blocks_++;
        }
        const std::uint32_t first = open_[best];
        open_[best] += count;
        if (open_[best] % lanes == 0) open_[best] = full;
        return first;
    }
    [[nodiscard]] std::uint32_t blocks() const { return blocks_; }

private:
    static constexpr std::uint32_t full = ~std::uint32_t{0};
    static std::uint32_t room(std::uint32_t next) {
        return next == full ? 0 : lanes - next % lanes;
    }
    std::array<std::uint32_t, 4> open_{full, full, full, full};  // next places
    std::uint32_t blocks_ = 0;
};

}  // namespace raydix
