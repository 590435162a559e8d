// A counter that all ranks share. It lies on rank 0 and is counted up by one-sided calls, so that
// nobody waits for a rank that computes.
#pragma once

#include <cstdint>

#include "mpi/communicator.h"

namespace raydix::mpi {

class TileCounter {
public:
    /// Collective, as the destructor is.
    explicit TileCounter(const Communicator& comm);
    ~TileCounter();
    TileCounter(const TileCounter&) = delete;
    TileCounter& operator=(const TileCounter&) = delete;

    /// How often it was taken before, by any rank.
    [[nodiscard]] std::uint64_t take() { return add(1); }
    /// From now on all ranks take numbers of 2^62 or more.
    void end() { static_cast<void>(add(std::uint64_t{1} << 62)); }

private:
    [[nodiscard]] std::uint64_t add(std::uint64_t value);

    MPI_Win window_ = MPI_WIN_NULL;
    std::uint64_t* memory_ = nullptr;  // of rank 0
};

}  // namespace raydix::mpi
