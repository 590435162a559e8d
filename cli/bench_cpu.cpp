// raydix bench cpu: hands over to the program bench_cpu beside this one. That one is linked with
// Embree, this one must run without.
#include <raydix/error.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "options.h"

namespace raydix::cli {
namespace {

/// Returns only by an exception.
void become_bench_cpu(std::vector<std::string> arguments) {
    std::error_code error;
    const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
    std::string program = (self.parent_path() / "bench_cpu").string();
    if (error || !std::filesystem::exists(program))
        throw BackendUnavailable(
            "bench cpu: the program bench_cpu is not beside raydix; it is built with RAYDIX_BENCH "
            "where CMake finds Embree 3 or 4 (Debian: libembree-dev)");
    std::vector<char*> pointers{program.data()};
    for (std::string& argument : arguments) pointers.push_back(argument.data());
    pointers.push_back(nullptr);
    execv(program.c_str(), pointers.data());
    throw BackendUnavailable(program + ": cannot be run: " + std::strerror(errno));
}

}  // namespace

void add_cpu_suite(CLI::App& bench) {
    CLI::App* command = bench.add_subcommand(
        "cpu", "The CPU tracer beside Embree: builds, bytes, rays (needs the program bench_cpu)");
    command->set_help_flag();  // --help and everything else are for the other program
    command->prefix_command();
    command->callback([command] { become_bench_cpu(command->remaining()); });
}

}  // namespace raydix::cli
