// An array that owns its memory or views a mapped file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>

namespace raydix {

/// Memory that is aligned to 64 bytes, uninitialised, and counted in peak_bytes. Null for 0 bytes.
/// Throws std::bad_alloc.
[[nodiscard]] std::shared_ptr<void> allocate_bytes(std::size_t bytes);

/// Move-only. Elements are plain data and start uninitialised.
template <class T>
class Buffer {
    static_assert(std::is_trivially_copyable_v<T>);

public:
    Buffer() = default;
    explicit Buffer(std::size_t size) { reset(size); }
    /// Views `size` elements at `data`, which `owner` keeps alive. They may be read-only: `reset`
    /// takes memory of its own in their place.
    Buffer(std::shared_ptr<void> owner, T* data, std::size_t size)
        : owner_(std::move(owner)), data_(data), size_(size) {}
    Buffer(Buffer&& other) noexcept { swap(other); }
    Buffer& operator=(Buffer&& other) noexcept {
        Buffer moved(std::move(other));
        swap(moved);
        return *this;
    }

    /// Makes room for `size` elements. The old ones are lost. Keeps the memory if it is large
    /// enough. Throws std::bad_alloc.
    void reset(std::size_t size) {
        if (size > capacity_) {
            *this = Buffer();  // give the old memory back first: it is not needed beside the new
            owner_ = allocate_bytes(size * sizeof(T));
            data_ = static_cast<T*>(owner_.get());
            capacity_ = size;
        }
        size_ = size;
    }

    [[nodiscard]] T* data() { return data_; }
    [[nodiscard]] const T* data() const { return data_; }
    [[nodiscard]] std::size_t size() const { return size_; }
    [[nodiscard]] bool empty() const { return size_ == 0; }
    [[nodiscard]] std::size_t capacity_bytes() const { return capacity_ * sizeof(T); }
    [[nodiscard]] std::span<T> span() { return {data_, size_}; }
    [[nodiscard]] std::span<const T> view() const { return {data_, size_}; }
    [[nodiscard]] T& operator[](std::size_t i) { return data_[i]; }
    [[nodiscard]] const T& operator[](std::size_t i) const { return data_[i]; }

private:
    void swap(Buffer& other) noexcept {
        std::swap(owner_, other.owner_);
        std::swap(data_, other.data_);
        std::swap(size_, other.size_);
        std::swap(capacity_, other.capacity_);
    }

    std::shared_ptr<void> owner_;
    T* data_ = nullptr;
    std::size_t size_ = 0;
    std::size_t capacity_ = 0;
};

}  // namespace raydix
