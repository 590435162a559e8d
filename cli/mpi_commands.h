// The commands of raydix_mpi: each adds itself to the program.
#pragma once

#include <CLI/CLI.hpp>

namespace raydix::cli {

void add_mpi_info(CLI::App& app);
void add_mpi_trace(CLI::App& app);
void add_mpi_query(CLI::App& app);
void add_mpi_render(CLI::App& app);
void add_mpi_bench(CLI::App& app);

}  // namespace raydix::cli
