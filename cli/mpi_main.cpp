// raydix_mpi, the program that `raydix mpi` becomes. Rank 0 alone prints. A rank that fails alone
// says so and ends all.
#include <fcntl.h>
#include <mpi.h>
#include <raydix/version.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <string>
#include <thread>

#include "mpi_commands.h"
#include "mpi_ranks.h"
#include "program.h"

namespace raydix::cli {
namespace {

/// Collective. Throws a usage error, on all ranks, if one has other arguments than rank 0: it would
/// wait for calls that never come.
void require_same_arguments(int argc, char** argv) {
    std::string mine;
    for (int i = 1; i < argc; ++i) mine.append(i == 1 ? "" : " ").append(argv[i]);
    std::string first = mine;
    std::uint64_t size = mine.size();
    MPI_Bcast(&size, 1, MPI_UINT64_T, 0, MPI_COMM_WORLD);
    first.resize(size);
    MPI_Bcast(first.data(), static_cast<int>(size), MPI_CHAR, 0, MPI_COMM_WORLD);
    on_each([&] {
        if (mine != first)
            throw CLI::ValidationError("started with '" + mine + "', and rank 0 with '" + first +
                                       "'; all ranks need the same arguments");
    });
}

int run(int argc, char** argv) {
    try {
        require_same_arguments(argc, argv);
    } catch (const CLI::ParseError& error) {
        complain(error.what());
        return 2;
    }
    CLI::App app("Scenes and points spread over the ranks of mpirun.", "raydix mpi");
    app.set_version_flag("--version", std::string("raydix ") + raydix::version);
    app.set_help_all_flag("--help-all", "Print this message with the options of all commands");
    app.require_subcommand(1);
    add_mpi_info(app);
    add_mpi_trace(app);
    add_mpi_query(app);
    add_mpi_render(app);
    add_mpi_bench(app);
    return run_program(app, argc, argv);
}

/// Whether all ranks come here within two seconds.
bool all_arrive(MPI_Comm comm) {
    MPI_Request request;
    MPI_Ibarrier(comm, &request);
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(2);
    for (;;) {
        int done = 0;
        MPI_Test(&request, &done, MPI_STATUS_IGNORE);
        if (done != 0) return true;
        if (std::chrono::steady_clock::now() > end) return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
}

/// Ranks other than the first say nothing.
void silence() {
    const int nowhere = open("/dev/null", O_WRONLY);
    dup2(nowhere, STDOUT_FILENO);
    dup2(nowhere, STDERR_FILENO);
    close(nowhere);
}

}  // namespace
}  // namespace raydix::cli

int main(int argc, char** argv) {
    using namespace raydix::cli;
    int level = 0;
    MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &level);
    MPI_Comm ending;
    MPI_Comm_dup(MPI_COMM_WORLD, &ending);
    const int errors = dup(STDERR_FILENO);
    if (mpi_rank() != 0) silence();
    const int code = run(argc, argv);
    if (code != 0 && !all_arrive(ending)) {  // the others wait for this rank
        if (mpi_rank() != 0)
            dprintf(errors, "raydix: rank %d failed alone and ends all\n", mpi_rank());
        MPI_Abort(MPI_COMM_WORLD, code);
    }
    if (code == 0) MPI_Barrier(ending);
    MPI_Comm_free(&ending);
    MPI_Finalize();
    return code;
}
