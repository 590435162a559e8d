// How every program of this folder's commands ends. Exit code 0: done; 1: the input or the machine
// is at fault; 2: usage.
#pragma once

#include <CLI/CLI.hpp>
#include <string_view>

namespace raydix::cli {

/// One line on standard error, whatever `reason` holds. Where that cannot be written it is lost.
void complain(std::string_view reason);

/// Parses and runs; what goes wrong becomes one line on standard error.
[[nodiscard]] int run_program(CLI::App& app, int argc, char** argv);

}  // namespace raydix::cli
