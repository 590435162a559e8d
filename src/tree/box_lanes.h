// Boxes of clusters for searches that look at four places at once. [n] boxes, coordinate by
// coordinate.
#pragma once

#include <raydix/buffer.h>
#include <raydix/types.h>

#include <array>
#include <cstdint>

namespace raydix {

/// Boxes as six arrays, lo x y z hi x y z, with boxes of infinite area on both sides, so that
/// searches need not know where the list ends.
class BoxLanes {
public:
    static constexpr std::uint32_t margin = 128;

    void reset(std::uint32_t capacity);
    /// As reset, in memory that somebody else keeps: floats_for(capacity) of them, on a cache line.
    void place(float* memory, std::uint32_t capacity);
    [[nodiscard]] static constexpr std::size_t floats_for(std::uint32_t capacity) {
        return 6 * stride_for(capacity);
    }
    /// Puts the box of infinite area on all places of the margin behind `count`.
    void close(std::uint32_t count);

    [[nodiscard]] const float* lane(std::size_t k) const { return lanes_[k]; }
    [[nodiscard]] float* lane(std::size_t k) { return lanes_[k]; }
    void set(std::uint32_t i, const Aabb& box) {
        lanes_[0][i] = box.lo.x;
        lanes_[1][i] = box.lo.y;
        lanes_[2][i] = box.lo.z;
        lanes_[3][i] = box.hi.x;
        lanes_[4][i] = box.hi.y;
        lanes_[5][i] = box.hi.z;
    }
    [[nodiscard]] Aabb get(std::uint32_t i) const {
        return {{lanes_[0][i], lanes_[1][i], lanes_[2][i]},
                {lanes_[3][i], lanes_[4][i], lanes_[5][i]}};
    }
    [[nodiscard]] std::size_t capacity_bytes() const { return memory_.capacity_bytes(); }

private:
    /// Each lane starts on a cache line of its own, with a margin on both sides.
    [[nodiscard]] static constexpr std::size_t stride_for(std::uint32_t capacity) {
        return (std::size_t{capacity} + 2 * margin + 15) / 16 * 16;
    }

    Buffer<float> memory_;
    std::array<float*, 6> lanes_{};
};

}  // namespace raydix
