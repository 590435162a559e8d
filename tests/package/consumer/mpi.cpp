// Points over the ranks of MPI; compiled and linked where raydix has the component.
#include <raydix/mpi.h>

int main(int argc, char** argv) {
    int level = 0;
    MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &level);
    std::uint64_t found = 0;
    {
        const raydix::Vec3 point{1, 2, 3};
        const raydix::mpi::DistributedPoints points(MPI_COMM_WORLD, {&point, 1});
        found = points.knn({&point, 1}, 1).counts.found;
    }
    MPI_Finalize();
    return found == 1 ? 0 : 1;
}
