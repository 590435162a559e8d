// Numbers that count through the ranks, of what this one holds.
#pragma once

#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

namespace raydix::mpi {

/// Ascending: what comes first here comes first among all. Four bytes a number where they can be:
/// every 256th is kept whole, and of the others how far they are behind it.
class GlobalIds {
public:
    /// Of a rank that kept what it gave.
    explicit GlobalIds(std::uint64_t first = 0) : first_(first) {}
    /// Of one that was given a part; ids ascend.
    explicit GlobalIds(std::vector<std::uint64_t> ids) {
        constexpr std::uint64_t farthest = std::numeric_limits<std::uint32_t>::max();
        steps_.reserve(ids.size());
        for (std::size_t i = 0; i < ids.size(); ++i) {
            if (i % per_base == 0) bases_.push_back(ids[i]);
            const std::uint64_t step = ids[i] - bases_.back();
            if (step > farthest) {  // few numbers of very many: all are kept whole
                steps_ = {};
                bases_ = std::move(ids);
                return;
            }
            steps_.push_back(static_cast<std::uint32_t>(step));
        }
    }

    [[nodiscard]] std::uint64_t of(std::uint32_t local) const {
        if (bases_.empty()) return first_ + local;
        return steps_.empty() ? bases_[local] : bases_[local / per_base] + steps_[local];
    }
    [[nodiscard]] std::uint64_t bytes() const {
        return bases_.size() * sizeof(std::uint64_t) + steps_.size() * sizeof(std::uint32_t);
    }

private:
    static constexpr std::uint32_t per_base = 256;
    std::uint64_t first_ = 0;
    std::vector<std::uint64_t> bases_;
    std::vector<std::uint32_t> steps_;
};

}  // namespace raydix::mpi
