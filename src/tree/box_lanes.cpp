#include "tree/box_lanes.h"

#include <algorithm>

namespace raydix {

void BoxLanes::reset(std::uint32_t capacity) {
    memory_.reset(floats_for(capacity));
    place(memory_.data(), capacity);
}

void BoxLanes::place(float* memory, std::uint32_t capacity) {
    for (std::size_t k = 0; k < 6; ++k) {
        lanes_[k] = memory + k * stride_for(capacity) + margin;
        const float infinite = k < 3 ? -infinity : infinity;
        std::fill(lanes_[k] - margin, lanes_[k], infinite);
    }
}

void BoxLanes::close(std::uint32_t count) {
    for (std::size_t k = 0; k < 6; ++k)
        std::fill(lanes_[k] + count, lanes_[k] + count + margin, k < 3 ? -infinity : infinity);
}

}  // namespace raydix
