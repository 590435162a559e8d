// Bytes from every rank to every other, in messages of bounded size; and values in such bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <span>
#include <type_traits>
#include <vector>

#include "mpi/communicator.h"

namespace raydix::mpi {

using Bytes = std::vector<std::byte>;

template <class T>
void put(Bytes& bytes, const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    const std::size_t size = bytes.size();
    bytes.resize(size + sizeof(T));  // faster than to insert bytes
    std::memcpy(bytes.data() + size, &value, sizeof(T));
}

/// Takes values out of bytes in the order in which they were put there.
class Reader {
public:
    explicit Reader(std::span<const std::byte> bytes) : bytes_(bytes) {}
    template <class T>
    [[nodiscard]] T take() {
        T value;
        std::memcpy(&value, bytes_.data(), sizeof(T));
        bytes_ = bytes_.subspan(sizeof(T));
        return value;
    }
    [[nodiscard]] bool empty() const { return bytes_.empty(); }
    [[nodiscard]] std::span<const std::byte> rest() const { return bytes_; }

private:
    std::span<const std::byte> bytes_;
};

/// What came from each rank.
class Arrived {
public:
    Arrived() = default;
    Arrived(Bytes bytes, std::vector<std::uint64_t> starts)
        : bytes_(std::move(bytes)), starts_(std::move(starts)) {}
    [[nodiscard]] std::span<const std::byte> from(int rank) const {
        const std::uint64_t begin = starts_[std::size_t(rank)];
        return {bytes_.data() + begin, std::size_t(starts_[std::size_t(rank) + 1] - begin)};
    }
    [[nodiscard]] std::span<const std::byte> all() const { return bytes_; }

private:
    Bytes bytes_;
    std::vector<std::uint64_t> starts_;  // [ranks + 1]
};

/// Collective. out [ranks] -> what they sent to this one. No message is longer than `most_bytes`;
/// what a rank sends to itself is copied and not counted. `error`: what already went wrong here.
/// An error of any rank is thrown on all before data is sent; so is lack of memory for what comes.
[[nodiscard]] Arrived exchange(const Communicator& comm, const std::vector<Bytes>& out,
                               std::uint64_t most_bytes, std::exception_ptr error = nullptr);

}  // namespace raydix::mpi
