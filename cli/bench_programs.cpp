// raydix bench cpu, scene and points: programs beside this one, linked with Embree and compiled
// with nanoflann.
#include "options.h"
#include "other_program.h"

namespace raydix::cli {

void add_cpu_suite(CLI::App& bench) {
    add_other_program(bench, "cpu", "The CPU tracer beside Embree: builds, bytes, rays",
                      "CMake finds Embree 3 or 4 (Debian: libembree-dev)");
}

void add_scene_suite(CLI::App& bench) {
    add_other_program(bench, "scene",
                      "Instances, spheres, filters, distances beside Embree; doubles beside floats",
                      "CMake finds Embree 3 or 4 (Debian: libembree-dev)");
}

void add_points_suite(CLI::App& bench) {
    add_other_program(bench, "points",
                      "The index of points beside nanoflann: builds, nearest points, radius",
                      "CMake finds nanoflann (Debian: libnanoflann-dev)");
}

}  // namespace raydix::cli
