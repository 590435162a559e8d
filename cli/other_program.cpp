#include "other_program.h"

#include <raydix/error.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <vector>

namespace raydix::cli {
namespace {

/// Returns only by an exception.
void become(const std::string& name, const std::string& needs, std::vector<std::string> arguments) {
    std::error_code error;
    const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
    std::string program = (self.parent_path() / ("bench_" + name)).string();
    if (error || !std::filesystem::exists(program))
        throw BackendUnavailable("bench " + name + ": the program bench_" + name +
                                 " is not beside raydix; it is built with RAYDIX_BENCH where " +
                                 needs);
    std::vector<char*> pointers{program.data()};
    for (std::string& argument : arguments) pointers.push_back(argument.data());
    pointers.push_back(nullptr);
    execv(program.c_str(), pointers.data());
    throw BackendUnavailable(program + ": cannot be run: " + std::strerror(errno));
}

}  // namespace

void add_other_program(CLI::App& bench, const std::string& name, const std::string& what,
                       const std::string& needs) {
    CLI::App* command =
        bench.add_subcommand(name, what + " (needs the program bench_" + name + ")");
    command->set_help_flag();  // --help and everything else are for the other program
    command->prefix_command();
    command->callback([command, name, needs] { become(name, needs, command->remaining()); });
}

}  // namespace raydix::cli
