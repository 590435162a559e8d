#include "other_program.h"

#include <raydix/error.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <vector>

namespace raydix::cli {

std::filesystem::path program_beside(const std::string& name) {
    std::error_code error;
    const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
    const std::filesystem::path program = self.parent_path() / name;
    return error || !std::filesystem::exists(program) ? std::filesystem::path() : program;
}

namespace {

/// Returns only by an exception.
void become(const OtherProgram& other, std::vector<std::string> arguments) {
    std::string program = program_beside(other.program).string();
    if (program.empty())
        throw BackendUnavailable(other.command + ": the program " + other.program +
                                 " is not beside raydix; it is built " + other.built_if);
    std::vector<char*> pointers{program.data()};
    for (std::string& argument : arguments) pointers.push_back(argument.data());
    pointers.push_back(nullptr);
    execv(program.c_str(), pointers.data());
    throw BackendUnavailable(program + ": cannot be run: " + std::strerror(errno));
}

}  // namespace

void add_other_program(CLI::App& parent, const std::string& name, const std::string& what,
                       const OtherProgram& other) {
    CLI::App* command =
        parent.add_subcommand(name, what + " (needs the program " + other.program + ")");
    command->set_help_flag();  // --help and everything else are for the other program
    command->prefix_command();
    command->callback([command, other] { become(other, command->remaining()); });
}

}  // namespace raydix::cli
