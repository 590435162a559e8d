// Numbers that count through the ranks, of what this one holds.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

namespace raydix::mpi {

/// Ascending: what comes first here comes first among all.
class GlobalIds {
public:
    /// Of a rank that kept what it gave.
    explicit GlobalIds(std::uint64_t first = 0) : first_(first) {}
    /// Of one that was given a part; ids ascend.
    explicit GlobalIds(std::vector<std::uint64_t> ids) : ids_(std::move(ids)) {}

    [[nodiscard]] std::uint64_t of(std::uint32_t local) const {
        return ids_.empty() ? first_ + local : ids_[local];
    }
    [[nodiscard]] std::uint64_t bytes() const { return ids_.size() * sizeof(std::uint64_t); }

private:
    std::uint64_t first_ = 0;
    std::vector<std::uint64_t> ids_;
};

}  // namespace raydix::mpi
