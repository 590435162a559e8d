// Refuses machines that cannot be, before any work is done for them.
#pragma once

#include <raydix/bvh.h>
#include <raydix/simulate.h>

#include <span>
#include <string>

#include "options.h"

namespace raydix::cli {

/// Throws InputError if a run has a machine that cannot be; it names the file if there is one.
inline void check_machine(const std::string& name_or_file, std::span<const SimulateOptions> runs) {
    const auto check = [&] { static_cast<void>(simulate(WarpTree(Bvh{}), {}, runs)); };
    name_or_file.ends_with(".json") ? about(name_or_file, check) : check();
}

}  // namespace raydix::cli
