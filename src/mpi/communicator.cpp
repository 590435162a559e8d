#include "mpi/communicator.h"

#include <raydix/error.h>

#include <limits>

namespace raydix::mpi {
namespace {

void require_running() {
    int running = 0, ended = 0, level = 0;
    MPI_Initialized(&running);
    MPI_Finalized(&ended);
    if (running == 0 || ended != 0)
        throw InputError(running == 0 ? "MPI is not running: call MPI_Init_thread before"
                                      : "MPI has ended: MPI_Finalize was called");
    MPI_Query_thread(&level);
    if (level < MPI_THREAD_FUNNELED)
        throw InputError(
            "MPI was started for one thread: call MPI_Init_thread with "
            "MPI_THREAD_FUNNELED or more");
}

}  // namespace

void check_mpi(int code, const char* call) {
    if (code == MPI_SUCCESS) return;
    char text[MPI_MAX_ERROR_STRING] = {};
    int length = 0;
    MPI_Error_string(code, text, &length);
    throw CommunicationError(std::string(call) + ": " + std::string(text, std::size_t(length)));
}

Communicator::Communicator(MPI_Comm comm) {
    require_running();
    if (comm == MPI_COMM_NULL) throw InputError("the communicator is MPI_COMM_NULL");
    int between_groups = 0;
    check_mpi(MPI_Comm_test_inter(comm, &between_groups), "MPI_Comm_test_inter");
    if (between_groups != 0) throw InputError("the communicator is one between two groups");
    check_mpi(MPI_Comm_dup(comm, &comm_), "MPI_Comm_dup");
    MPI_Comm_set_errhandler(comm_, MPI_ERRORS_RETURN);
    MPI_Comm_rank(comm_, &rank_);
    MPI_Comm_size(comm_, &size_);
}

Communicator::~Communicator() {
    int ended = 0;
    MPI_Finalized(&ended);
    if (ended == 0 && comm_ != MPI_COMM_NULL) MPI_Comm_free(&comm_);
}

void Communicator::reduce(std::uint64_t* values, int n, MPI_Op op) const {
    ++traffic_.collectives;
    check_mpi(MPI_Allreduce(MPI_IN_PLACE, values, n, MPI_UINT64_T, op, comm_), "MPI_Allreduce");
}

void Communicator::reduce(double* values, int n, MPI_Op op) const {
    ++traffic_.collectives;
    check_mpi(MPI_Allreduce(MPI_IN_PLACE, values, n, MPI_DOUBLE, op, comm_), "MPI_Allreduce");
}

std::uint64_t Communicator::sum_before(std::uint64_t value) const {
    ++traffic_.collectives;
    std::uint64_t sum = 0;
    check_mpi(MPI_Exscan(&value, &sum, 1, MPI_UINT64_T, MPI_SUM, comm_), "MPI_Exscan");
    return rank_ == 0 ? 0 : sum;  // of the first rank MPI leaves it undefined
}

std::vector<std::uint64_t> Communicator::transpose(const std::vector<std::uint64_t>& out) const {
    ++traffic_.collectives;
    std::vector<std::uint64_t> in(out.size());
    check_mpi(MPI_Alltoall(out.data(), 1, MPI_UINT64_T, in.data(), 1, MPI_UINT64_T, comm_),
              "MPI_Alltoall");
    return in;
}

Communicator::Ranges Communicator::gathered_ranges(std::uint64_t bytes) const {
    ++traffic_.collectives;
    std::vector<std::uint64_t> sizes(std::size_t(size_), 0);
    check_mpi(MPI_Allgather(&bytes, 1, MPI_UINT64_T, sizes.data(), 1, MPI_UINT64_T, comm_),
              "MPI_Allgather");
    Ranges ranges;
    std::uint64_t sum = 0;
    for (const std::uint64_t size : sizes) {
        ranges.counts.push_back(static_cast<int>(size));
        ranges.starts.push_back(static_cast<int>(sum));
        sum += size;
        if (sum > std::uint64_t(std::numeric_limits<int>::max()))
            throw InputError("the ranks' boxes or samples together exceed 2^31 bytes");
    }
    return ranges;
}

void Communicator::gather_bytes(const void* mine, const std::vector<int>& counts,
                                const std::vector<int>& starts, void* all) const {
    ++traffic_.collectives;
    check_mpi(MPI_Allgatherv(mine, counts[std::size_t(rank_)], MPI_BYTE, all, counts.data(),
                             starts.data(), MPI_BYTE, comm_),
              "MPI_Allgatherv");
}

std::string Communicator::broadcast(std::string text, int from) const {
    ++traffic_.collectives;
    std::uint64_t length = text.size();
    check_mpi(MPI_Bcast(&length, 1, MPI_UINT64_T, from, comm_), "MPI_Bcast");
    text.resize(length);
    check_mpi(MPI_Bcast(text.data(), static_cast<int>(length), MPI_CHAR, from, comm_), "MPI_Bcast");
    return text;
}

}  // namespace raydix::mpi
