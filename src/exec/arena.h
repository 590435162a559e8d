// Carves the arrays of a builder's scratch out of one piece of memory that the caller owns. Without
// memory it only adds up: the same function is the size query and the layout.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/check.h"

namespace raydix {

class Arena {
public:
    static constexpr std::size_t alignment = 256;  // what a GPU's widest loads like

    /// A size query: `take` returns null, `bytes` grows.
    Arena() = default;
    Arena(void* memory, std::size_t capacity)
        : memory_(static_cast<std::byte*>(memory)), capacity_(capacity) {}

    template <class T>
    [[nodiscard]] T* take(std::size_t count) {
        const std::size_t at = bytes_;
        bytes_ += (count * sizeof(T) + alignment - 1) / alignment * alignment;
        if (memory_ == nullptr) return nullptr;
        RAYDIX_CHECK(bytes_, <=, capacity_);
        return reinterpret_cast<T*>(memory_ + at);
    }
    [[nodiscard]] std::size_t bytes() const { return bytes_; }

private:
    std::byte* memory_ = nullptr;
    [[maybe_unused]] std::size_t capacity_ = 0;  // of checks
    std::size_t bytes_ = 0;
};

}  // namespace raydix
