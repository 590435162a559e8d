// raydix bench: the suites, each in a file of its own.
#include <CLI/CLI.hpp>

#include "options.h"

namespace raydix::cli {

void add_bench_command(CLI::App& app) {
    CLI::App* bench = app.add_subcommand("bench", "Measure one question and print its tables");
    bench->require_subcommand(1);
    add_traversal_suite(*bench);
    add_cpu_suite(*bench);
    add_scene_suite(*bench);
    add_points_suite(*bench);
    add_hierarchy_suite(*bench);
}

}  // namespace raydix::cli
