// A communicator of the library's own: a duplicate of the caller's whose errors are exceptions, and
// whose messages are counted.
#pragma once

#include <mpi.h>
#include <raydix/mpi.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

namespace raydix::mpi {

/// Throws CommunicationError that names the call unless `code` is MPI_SUCCESS.
void check_mpi(int code, const char* call);

class Communicator {
public:
    /// Collective. Throws InputError: MPI is not running, its threads are not funnelled, or the
    /// communicator is MPI_COMM_NULL or one between groups.
    explicit Communicator(MPI_Comm comm);
    ~Communicator();
    Communicator(const Communicator&) = delete;
    Communicator& operator=(const Communicator&) = delete;

    [[nodiscard]] int rank() const { return rank_; }
    [[nodiscard]] int size() const { return size_; }
    [[nodiscard]] MPI_Comm handle() const { return comm_; }

    /// values [n] of all ranks, joined by `op`, in their place.
    void reduce(std::uint64_t* values, int n, MPI_Op op) const;
    void reduce(double* values, int n, MPI_Op op) const;
    /// The sum of `value` on the ranks before this one.
    [[nodiscard]] std::uint64_t sum_before(std::uint64_t value) const;
    /// One number for each rank goes out, one from each comes back: values [size].
    [[nodiscard]] std::vector<std::uint64_t> transpose(const std::vector<std::uint64_t>& out) const;
    /// What all ranks give, in rank order.
    template <class T>
    [[nodiscard]] std::vector<T> gather(const std::vector<T>& mine) const {
        static_assert(std::is_trivially_copyable_v<T>);
        std::vector<T> all;
        const auto [counts, starts] = gathered_ranges(mine.size() * sizeof(T));
        all.resize((std::size_t(starts.back()) + counts.back()) / sizeof(T));
        gather_bytes(mine.data(), counts, starts, all.data());
        return all;
    }
    /// The text of rank `from`, on all.
    [[nodiscard]] std::string broadcast(std::string text, int from) const;

    /// Counts data that goes to another rank.
    void count_message(std::uint64_t bytes) const {
        ++traffic_.messages;
        traffic_.bytes += bytes;
    }
    [[nodiscard]] const Traffic& traffic() const { return traffic_; }

private:
    struct Ranges {
        std::vector<int> counts, starts;
    };
    [[nodiscard]] Ranges gathered_ranges(std::uint64_t bytes) const;
    void gather_bytes(const void* mine, const std::vector<int>& counts,
                      const std::vector<int>& starts, void* all) const;

    MPI_Comm comm_ = MPI_COMM_NULL;
    int rank_ = 0, size_ = 1;
    mutable Traffic traffic_;
};

}  // namespace raydix::mpi
