// What the program says of itself beside --help: groups of options, manual pages, completion in
// shells. All of it is read off the commands, so that none of it can be older than they are.
#pragma once

#include <CLI/CLI.hpp>

namespace raydix::cli {

/// Puts the options of all commands under heads: scene, rays, output, run. Those that have a head
/// of their own keep it.
void group_options(CLI::App& app);

/// raydix completion SHELL
void add_completion_command(CLI::App& app);
/// raydix man [COMMAND...]
void add_man_command(CLI::App& app);

}  // namespace raydix::cli
