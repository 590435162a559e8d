// The partition `curve`: records of all ranks are sorted along one Morton curve, by samples,
// splitters and one exchange, so that each rank holds a run of about equal length. Ties of codes
// are told apart by numbers: equal places are divided among ranks too.
#pragma once

#include <algorithm>
#include <cstdint>
#include <exception>
#include <limits>
#include <numeric>
#include <vector>

#include "keys/morton.h"
#include "mpi/agree.h"
#include "mpi/communicator.h"
#include "mpi/exchange.h"
#include "mpi/rank_tree.h"

namespace raydix::mpi {

/// A place on the curve, and the number of what is there.
struct CurveKey {
    std::uint64_t code, id;

    friend auto operator<=>(const CurveKey&, const CurveKey&) = default;
};

/// 2^21 cells along the longest side of a box, the same on every rank.
class GlobalGrid {
public:
    /// Collective. `mine`: around what this rank gave.
    template <class T>
    GlobalGrid(const Communicator& comm, const RankBox<T>& mine) {
        double least[6];  // highs as negative lows: one minimum for all
        for (int d = 0; d < 3; ++d) {
            least[d] = double(mine.lo[d]);
            least[3 + d] = -double(mine.hi[d]);
        }
        comm.reduce(least, 6, MPI_MIN);
        double longest = 0;
        for (int d = 0; d < 3; ++d) {
            lo_[d] = least[d];
            longest = std::max(longest, -least[3 + d] - least[d]);
        }
        if (longest > 0)
            scale_ = std::min(double(1u << 21) / longest, std::numeric_limits<double>::max());
    }

    /// `at` must be finite.
    template <class T>
    [[nodiscard]] std::uint64_t code(const T* at) const {
        return interleave<std::uint64_t>({cell(at, 0), cell(at, 1), cell(at, 2)});
    }

private:
    template <class T>
    [[nodiscard]] std::uint32_t cell(const T* at, int d) const {
        constexpr double last = (1u << 21) - 1;
        return static_cast<std::uint32_t>(std::clamp((double(at[d]) - lo_[d]) * scale_, 0.0, last));
    }
    double lo_[3], scale_ = 0;
};

/// Collective. keys: ascending, those of this rank. Gives where the keys of each rank begin in
/// them, [ranks + 1]: rank r is to hold the keys from begins[r] to begins[r + 1] of every rank.
[[nodiscard]] std::vector<std::size_t> split_curve(const Communicator& comm,
                                                   const std::vector<CurveKey>& keys);

/// Collective. Sends each record to the rank that its key belongs to. records and keys [n] -> the
/// records that this rank holds, in any order.
template <class Record>
[[nodiscard]] std::vector<Record> partition_by_curve(const Communicator& comm,
                                                     std::vector<Record> records,
                                                     const std::vector<CurveKey>& keys,
                                                     std::uint64_t message_bytes) {
    std::vector<std::uint32_t> order;
    std::vector<CurveKey> sorted;
    together(comm, [&] {
        order.resize(keys.size());
        std::iota(order.begin(), order.end(), 0u);
        std::sort(order.begin(), order.end(),
                  [&](std::uint32_t a, std::uint32_t b) { return keys[a] < keys[b]; });
        sorted.resize(keys.size());
        for (std::size_t i = 0; i < order.size(); ++i) sorted[i] = keys[order[i]];
    });
    const std::vector<std::size_t> begins = split_curve(comm, sorted);
    std::vector<Bytes> out(std::size_t(comm.size()));
    std::exception_ptr error;
    keep_error(error, [&] {
        for (std::size_t r = 0; r < out.size(); ++r) {
            out[r].reserve((begins[r + 1] - begins[r]) * sizeof(Record));
            for (std::size_t i = begins[r]; i < begins[r + 1]; ++i) put(out[r], records[order[i]]);
        }
    });
    records = {};
    const Arrived arrived = exchange(comm, out, message_bytes, error);
    together(comm, [&] {
        const auto bytes = arrived.all();
        records.resize(bytes.size() / sizeof(Record));
        if (!records.empty()) std::memcpy(records.data(), bytes.data(), bytes.size());
    });
    return records;
}

}  // namespace raydix::mpi
