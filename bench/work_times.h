// Wall-clock and processor time of a piece of work, for benchmarks beside other libraries.
#pragma once

#include <algorithm>
#include <ctime>
#include <functional>
#include <nlohmann/json.hpp>
#include <vector>

#include "measure/stopwatch.h"

namespace raydix::bench {

struct Times {
    double wall = 0, cpu = 0;  // ms
};

inline Times time_of(const std::function<void()>& work) {
    const std::clock_t start = std::clock();
    Stopwatch watch;
    work();
    const double wall = watch.lap();
    return {wall, 1e3 * double(std::clock() - start) / CLOCKS_PER_SEC};
}

/// Of at least one time.
inline nlohmann::ordered_json spread_json(std::vector<Times> times, double Times::*field) {
    std::sort(times.begin(), times.end(),
              [&](const Times& a, const Times& b) { return a.*field < b.*field; });
    return {{"median", times[times.size() / 2].*field},
            {"min", times.front().*field},
            {"max", times.back().*field}};
}

}  // namespace raydix::bench
