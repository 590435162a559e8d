// Suites that need libraries which this program must run without are programs beside it.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>

namespace raydix::cli {

/// A program beside this one that a command becomes.
struct OtherProgram {
    std::string command;          // as the user types it, "bench cpu"
    std::string program;          // the file's name
    std::string built_if;         // ends the message where it is not there
    std::string help = "--help";  // makes it print all of its options
};

/// Where the program of this name is, beside this one. Empty: it was not built.
[[nodiscard]] std::filesystem::path program_beside(const std::string& name);

/// Adds the command `name`, which becomes the other program; all options are its own. The command's
/// footer is the other program's help, "" where it is not there.
void add_other_program(CLI::App& parent, const std::string& name, const std::string& what,
                       const OtherProgram& other);

}  // namespace raydix::cli
