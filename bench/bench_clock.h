// Wall-clock time, or processor time of all threads together for a machine that others use too.
#pragma once

#include <ctime>

#include "cli/options.h"

namespace raydix::bench {

inline void add_clock_option(CLI::App& app, std::string& clock) {
    app.add_option("--clock", clock,
                   "wall, or cpu: of all threads together, for a machine that others use too")
        ->check(CLI::IsMember({"wall", "cpu"}))
        ->capture_default_str();
}

inline clockid_t clock_from(const std::string& name) {
    return name == "cpu" ? CLOCK_PROCESS_CPUTIME_ID : CLOCK_MONOTONIC;
}

inline double seconds_of(clockid_t clock) {
    timespec now{};
    clock_gettime(clock, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace raydix::bench
