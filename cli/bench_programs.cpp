// raydix bench cpu, scene and points, and raydix mpi: programs beside this one, linked with Embree
// and MPI and compiled with nanoflann.
#include "options.h"
#include "other_program.h"

namespace raydix::cli {

namespace {

OtherProgram suite(const std::string& name, const std::string& needs) {
    return {"bench " + name, "bench_" + name, "with RAYDIX_BENCH where " + needs};
}

const char* const embree = "CMake finds Embree 3 or 4 (Debian: libembree-dev)";

}  // namespace

void add_cpu_suite(CLI::App& bench) {
    add_other_program(bench, "cpu", "The CPU tracer beside Embree: builds, bytes, rays",
                      suite("cpu", embree));
}

void add_scene_suite(CLI::App& bench) {
    add_other_program(bench, "scene",
                      "Instances, spheres, filters, distances beside Embree; doubles beside floats",
                      suite("scene", embree));
}

void add_points_suite(CLI::App& bench) {
    add_other_program(bench, "points",
                      "The index of points beside nanoflann: builds, nearest points, radius",
                      suite("points", "CMake finds nanoflann (Debian: libnanoflann-dev)"));
}

void add_mpi_command(CLI::App& app) {
    add_other_program(
        app, "mpi", "Scenes and points spread over the ranks of mpirun",
        {"mpi", "raydix_mpi", "with RAYDIX_MPI where CMake finds MPI (Debian: libopenmpi-dev)",
         "--help-all"});
}

}  // namespace raydix::cli
