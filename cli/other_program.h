// Suites that need libraries which this program must run without are programs beside it.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace raydix::cli {

/// Adds `raydix bench NAME`, which becomes the program bench_NAME beside this one; all options are
/// its own. `needs` ends the message where it is not there.
void add_other_program(CLI::App& bench, const std::string& name, const std::string& what,
                       const std::string& needs);

}  // namespace raydix::cli
