#include "other_program.h"

#include <fcntl.h>
#include <raydix/error.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
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

/// What the other program prints of itself.
std::string help_of(const OtherProgram& other) {
    std::string program = program_beside(other.program).string(), argument = other.help;
    int ends[2];
    if (program.empty() || pipe2(ends, O_CLOEXEC) != 0) return "";
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    char* const arguments[] = {program.data(), argument.data(), nullptr};
    pid_t child = 0;
    const bool runs =
        posix_spawn(&child, program.c_str(), &actions, nullptr, arguments, environ) == 0;
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    std::string text;
    std::array<char, 4096> part{};
    ssize_t got = 0;
    while (runs && (got = read(ends[0], part.data(), part.size())) > 0)
        text.append(part.data(), static_cast<std::size_t>(got));
    close(ends[0]);
    int end = 1;
    if (runs) waitpid(child, &end, 0);
    return end == 0 ? text : "";
}

}  // namespace

void add_other_program(CLI::App& parent, const std::string& name, const std::string& what,
                       const OtherProgram& other) {
    CLI::App* command =
        parent.add_subcommand(name, what + " (needs the program " + other.program + ")");
    command->set_help_flag();  // --help and everything else are for the other program
    command->prefix_command();
    command->footer([other] { return help_of(other); });
    command->callback([command, other] { become(other, command->remaining()); });
}

}  // namespace raydix::cli
