// The queries of a GPU (gpu/device_queries.h) on the host, by any launcher, into memory that begins
// as garbage and has a guard behind it.
#pragma once

#include <gtest/gtest.h>
#include <raydix/bvh.h>
#include <raydix/kdtree.h>

#include <cstring>
#include <vector>

#include "gpu/device_queries.h"

namespace raydix::test {

inline DevicePoints host_points(const KdTree& tree) {
    return {tree.nodes().data(),
            tree.order().data(),
            tree.points().data(),
            tree.bounds(),
            static_cast<std::uint32_t>(tree.order().size()),
            tree.max_depth()};
}
inline DevicePrimitives host_primitives(const Bvh& bvh) {
    const auto array = [](const auto& view) { return view.empty() ? nullptr : view.data(); };
    return {bvh.nodes().data(),
            bvh.order().data(),
            array(bvh.triangles()),
            array(bvh.boxes()),
            array(bvh.points()),
            static_cast<std::uint32_t>(bvh.input_count()),
            static_cast<std::uint32_t>(bvh.order().size()),
            bvh.max_depth()};
}

/// An array with garbage in it and behind it.
template <class T>
class GuardedArray {
public:
    explicit GuardedArray(std::size_t size) : size_(size), values_(size + guard) {
        std::memset(static_cast<void*>(values_.data()), 0xA5, values_.size() * sizeof(T));
    }
    ~GuardedArray() {
        for (std::size_t i = size_; i < values_.size(); ++i) EXPECT_TRUE(is_garbage(i));
    }
    GuardedArray(const GuardedArray&) = delete;
    GuardedArray& operator=(const GuardedArray&) = delete;

    [[nodiscard]] std::span<T> span() { return {values_.data(), size_}; }
    [[nodiscard]] const T& operator[](std::size_t i) const { return values_[i]; }
    [[nodiscard]] bool is_garbage(std::size_t i) const {
        unsigned char bytes[sizeof(T)];
        std::memcpy(bytes, &values_[i], sizeof(T));
        for (const unsigned char byte : bytes)
            if (byte != 0xA5) return false;
        return true;
    }
    /// Bit for bit.
    template <class Other>
    [[nodiscard]] std::size_t differences(const Other& other) const {
        std::size_t count = size_ != other.size();
        for (std::size_t i = 0; i < std::min(size_, std::size_t{other.size()}); ++i)
            count += std::memcmp(&values_[i], &other[i], sizeof(T)) != 0;
        return count;
    }

private:
    static constexpr std::size_t guard = 16;
    std::size_t size_;
    std::vector<T> values_;
};

}  // namespace raydix::test
