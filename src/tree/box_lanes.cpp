#include "tree/box_lanes.h"

#include <algorithm>

namespace raydix {

void BoxLanes::reset(std::uint32_t capacity) {
    // Each lane starts on a cache line of its own, with a margin on both sides.
    const std::size_t stride = (std::size_t{capacity} + 2 * margin + 15) / 16 * 16;
    memory_.reset(6 * stride);
    for (std::size_t k = 0; k < 6; ++k) {
        lanes_[k] = memory_.data() + k * stride + margin;
        const float infinite = k < 3 ? -infinity : infinity;
        std::fill(lanes_[k] - margin, lanes_[k], infinite);
    }
}

void BoxLanes::close(std::uint32_t count) {
    for (std::size_t k = 0; k < 6; ++k)
        std::fill(lanes_[k] + count, lanes_[k] + count + margin, k < 3 ? -infinity : infinity);
}

}  // namespace raydix
