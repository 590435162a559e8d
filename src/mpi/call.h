// The frame of a collective query: arguments are agreed on, rounds run, errors come out on all
// ranks, and what it took is counted.
#pragma once

#include <raydix/mpi.h>

#include <exception>
#include <string>

#include "base/float_env.h"
#include "mpi/agree.h"
#include "mpi/compute_clock.h"
#include "mpi/rounds.h"

namespace raydix::mpi {

/// Throws InputError for an option out of range.
void check_options(const Options& options);

/// The options that must not differ between ranks.
[[nodiscard]] std::string describe(const Options& options, const char* scalar);
template <class Scalar>
[[nodiscard]] std::string describe(const Options& options) {
    return describe(options, sizeof(Scalar) == 4 ? "float" : "double");
}

/// A number as text that differs if its bits do.
[[nodiscard]] std::string exact_text(double value);

class Call {
public:
    Call(const Communicator& comm, const Options& options)
        : comm_(comm),
          limits_{options.exchange_bytes, options.message_bytes},
          clock_(options.compute_gate),
          before_(comm.traffic()) {}

    /// Collective. `name`: the call and its arguments; check() throws for what is wrong with them.
    template <class Kind, class Check>
    void begin(const std::string& name, const Check& check) {
        together_on(comm_, name, [&] {
            require_share<Kind>(comm_, limits_);
            clock_.run(check);
        });
    }
    template <class Kind>
    void run(Kind& kind) {
        Rounds<Kind>(comm_, kind, limits_, clock_).run(nullptr, report_);
    }
    template <class Body>
    void finish(const Body& body) {
        together(comm_, [&] { clock_.run(body); });
    }
    [[nodiscard]] CallReport report() const {
        CallReport report = report_;
        const Traffic& now = comm_.traffic();
        report.traffic = {now.messages - before_.messages, now.bytes - before_.bytes,
                          now.collectives - before_.collectives};
        report.compute_seconds = clock_.seconds();
        return report;
    }

private:
    const FloatEnvironment plain_;
    const Communicator& comm_;
    RoundLimits limits_;
    ComputeClock clock_;
    Traffic before_;
    CallReport report_;
};

}  // namespace raydix::mpi
