// Processor time of the stretches in which a rank computes and does not wait for others.
#pragma once

#include <ctime>
#include <functional>
#include <utility>

namespace raydix::mpi {

class ComputeClock {
public:
    /// `gate`, if it is not empty, is called with true before each stretch and with false after it.
    explicit ComputeClock(std::function<void(bool)> gate) : gate_(std::move(gate)) {}

    template <class Body>
    void run(const Body& body) {
        const Stretch stretch(*this);
        body();
    }
    [[nodiscard]] double seconds() const { return seconds_; }

private:
    /// Ends also where the body throws.
    class Stretch {
    public:
        explicit Stretch(ComputeClock& clock) : clock_(clock) {
            if (clock_.gate_) clock_.gate_(true);
            start_ = now();
        }
        ~Stretch() {
            clock_.seconds_ += now() - start_;
            if (clock_.gate_) clock_.gate_(false);
        }
        Stretch(const Stretch&) = delete;
        Stretch& operator=(const Stretch&) = delete;

    private:
        ComputeClock& clock_;
        double start_ = 0;
    };

    /// Of all threads of the process.
    [[nodiscard]] static double now() {
        std::timespec time{};
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
        return double(time.tv_sec) + 1e-9 * double(time.tv_nsec);
    }

    std::function<void(bool)> gate_;
    double seconds_ = 0;
};

}  // namespace raydix::mpi
