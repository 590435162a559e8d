// Runs this program once more with other arguments and takes what it prints.
#pragma once

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <stdexcept>
#include <string>
#include <vector>

namespace raydix::bench {

inline std::string text_of(const std::vector<std::string>& arguments) {
    std::string text;
    for (const std::string& argument : arguments) text += " " + argument;
    return text;
}

/// Throws if it cannot be started or does not end with exit code 0.
inline std::string output_of_this_program(std::vector<std::string> arguments) {
    std::string self = "/proc/self/exe";
    std::vector<char*> pointers{self.data()};
    for (std::string& argument : arguments) pointers.push_back(argument.data());
    pointers.push_back(nullptr);
    std::array<int, 2> ends{};
    if (pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("no pipe can be opened");
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    pid_t child = 0;
    const int fault =
        posix_spawn(&child, self.c_str(), &actions, nullptr, pointers.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    std::string text;
    std::array<char, 4096> piece{};
    if (fault == 0)
        for (ssize_t n = 0; (n = read(ends[0], piece.data(), piece.size())) > 0;)
            text.append(piece.data(), static_cast<std::size_t>(n));
    close(ends[0]);
    int status = -1;
    if (fault != 0 || waitpid(child, &status, 0) != child || status != 0)
        throw std::runtime_error("a process of this program failed:" + text_of(arguments));
    return text;
}

}  // namespace raydix::bench
