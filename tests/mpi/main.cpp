// Runs all tests on every rank; fails if one of them fails anywhere.
#include <gtest/gtest.h>
#include <mpi.h>

#include "leaks.h"

using namespace raydix::mpi::test;

int main(int argc, char** argv) {
    {
        const MayLeak may_leak;
        int level = 0;
        MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &level);
    }
    testing::InitGoogleTest(&argc, argv);
    int rank = 0;
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    if (rank != 0) testing::GTEST_FLAG(brief) = true;  // failures only
    int failed = RUN_ALL_TESTS();
    MPI_Allreduce(MPI_IN_PLACE, &failed, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
    require_no_leaks();
    MPI_Finalize();
    return failed;
}
