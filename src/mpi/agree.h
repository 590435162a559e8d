// Errors and arguments of collective calls: what goes wrong on one rank is thrown on all, and ranks
// that call different things, or with different options, find out.
#pragma once

#include <cstdint>
#include <exception>
#include <string>

#include "mpi/communicator.h"

namespace raydix::mpi {

/// Collective. Returns if no rank has an error. Else throws on every rank the error of the lowest
/// rank that has one, as InputError, ResultTooLarge, BackendUnavailable, std::bad_alloc or
/// std::runtime_error; its message begins with that rank.
void agree(const Communicator& comm, const std::exception_ptr& error);

/// As `agree`; and without an error, throws InputError on all ranks if `call` is not the same text
/// on each: the name of a call and those of its arguments that must not differ.
void agree_on(const Communicator& comm, const std::string& call, const std::exception_ptr& error);

/// Collective. The sum of `work` over all ranks; throws as `agree`.
[[nodiscard]] std::uint64_t agree_on_work(const Communicator& comm, std::uint64_t work,
                                          const std::exception_ptr& error);

/// Runs `body`. The first error stays in `error`.
template <class Body>
void keep_error(std::exception_ptr& error, const Body& body) {
    if (error) return;
    try {
        body();
    } catch (...) {
        error = std::current_exception();
    }
}

/// Collective: runs `body` on every rank; an error on one is thrown on all.
template <class Body>
void together(const Communicator& comm, const Body& body) {
    std::exception_ptr error;
    keep_error(error, body);
    agree(comm, error);
}

/// The same, and the ranks must call the same.
template <class Body>
void together_on(const Communicator& comm, const std::string& call, const Body& body) {
    std::exception_ptr error;
    keep_error(error, body);
    agree_on(comm, call, error);
}

}  // namespace raydix::mpi
