// How every program of this folder's commands ends. Exit code 0: done; 1: the input or the machine
// is at fault; 2: usage.
#pragma once

#include <CLI/CLI.hpp>

namespace raydix::cli {

/// Parses and runs; what goes wrong becomes one line on standard error.
[[nodiscard]] int run_program(CLI::App& app, int argc, char** argv);

}  // namespace raydix::cli
