#include "mpi/tile_counter.h"

namespace raydix::mpi {

TileCounter::TileCounter(const Communicator& comm) {
    const MPI_Aint bytes = comm.rank() == 0 ? MPI_Aint(sizeof(std::uint64_t)) : 0;
    check_mpi(MPI_Win_allocate(bytes, sizeof(std::uint64_t), MPI_INFO_NULL, comm.handle(), &memory_,
                               &window_),
              "MPI_Win_allocate");
    MPI_Win_set_errhandler(window_, MPI_ERRORS_RETURN);
    if (comm.rank() == 0) {
        MPI_Win_lock(MPI_LOCK_EXCLUSIVE, 0, 0, window_);
        *memory_ = 0;
        MPI_Win_unlock(0, window_);
    }
    MPI_Barrier(comm.handle());  // nobody counts before it is 0
    MPI_Win_lock_all(0, window_);
}

TileCounter::~TileCounter() {
    MPI_Win_unlock_all(window_);
    MPI_Win_free(&window_);
}

std::uint64_t TileCounter::add(std::uint64_t value) {
    std::uint64_t before = 0;
    check_mpi(MPI_Fetch_and_op(&value, &before, MPI_UINT64_T, 0, 0, MPI_SUM, window_),
              "MPI_Fetch_and_op");
    check_mpi(MPI_Win_flush(0, window_), "MPI_Win_flush");
    return before;
}

}  // namespace raydix::mpi
