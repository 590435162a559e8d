// The whole program behind main(): apart, so that main.cpp needs no header of the options.
#pragma once

namespace raydix::cli {

/// Reads the arguments, runs the command that they name and returns the exit code.
int run_raydix(int argc, char** argv);

}  // namespace raydix::cli
