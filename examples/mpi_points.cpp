// Nearest points over ranks: mpirun -n 4 mpi_points
#include <raydix/mpi.h>

#include <cstdio>

int main(int argc, char** argv) {
    // [points]
    int level, rank;
    MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &level);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    {
        std::vector<raydix::Vec3> mine;  // a row of points along x for each rank
        for (int i = 0; i < 1000; ++i) mine.push_back({float(i), float(rank), 0.0f});
        const raydix::mpi::DistributedPoints points(MPI_COMM_WORLD, mine);
        const raydix::Vec3 query{500.0f, float(rank) + 0.75f, 0.0f};
        const auto nearest = points.knn({&query, 1}, 1);
        std::printf("rank %d: point %llu\n", rank, (unsigned long long)nearest.indices[0]);
    }
    MPI_Finalize();
    // [end]
}
