// Where the triangles of leaves go: into blocks of eight, no leaf over the end of one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace raydix {

/// Puts each leaf into the block that it fills best of a few that are not full.
class BlockFiller {
public:
    static constexpr std::uint32_t lanes = 8;

    /// The place of the first of `count` triangles, 1 to 8: lane place % 8 of block place / 8.
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
