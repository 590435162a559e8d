// The options of builds that number codes and leaves, checked.
#pragma once

#include <raydix/bvh.h>
#include <raydix/error.h>

#include <string>

namespace raydix {

/// Throws InputError: bits other than 30 and 63, leaves of none or of more than 255.
inline void check_code_options(const BuildOptions& options) {
    if (options.bits != 30 && options.bits != 63)
        throw InputError("build option bits is " + std::to_string(options.bits) +
                         "; it must be 30 or 63");
    if (options.max_leaf < 1 || options.max_leaf > 255)
        throw InputError("build option max_leaf is " + std::to_string(options.max_leaf) +
                         "; it must be 1 to 255");
}

}  // namespace raydix
