// Wall time in milliseconds.
#pragma once

#include <chrono>

namespace raydix {

class Stopwatch {
public:
    /// Since construction or the last call of lap().
    double lap() {
        const auto now = Clock::now();
        const double ms = std::chrono::duration<double, std::milli>(now - start_).count();
        start_ = now;
        return ms;
    }

private:
    using Clock = std::chrono::steady_clock;
    Clock::time_point start_ = Clock::now();
};

}  // namespace raydix
