// What the files of the module raydix._mpi share: the communicator, options, figures.
#pragma once

#include <mpi.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/tuple.h>
#include <raydix/mpi.h>

#include <cstdint>
#include <tuple>

namespace raydix::python {

/// What mpi4py's Comm.py2f() gave.
[[nodiscard]] inline MPI_Comm communicator_of(int handle) { return MPI_Comm_f2c(handle); }

/// partition is curve, strict, threads, exchange_bytes, message_bytes, boxes_per_rank.
using OptionValues = std::tuple<bool, bool, int, std::uint64_t, std::uint64_t, std::uint32_t>;
void set_options(mpi::Options& options, const OptionValues& values);

/// call() without the interpreter's lock.
template <class Call>
auto unlocked(const Call& call) {
    const nanobind::gil_scoped_release released;
    return call();
}

[[nodiscard]] nanobind::dict figures_of(const mpi::CallReport& report);
[[nodiscard]] nanobind::dict figures_of(const mpi::Holding& holding);

void bind_distributed_points(nanobind::module_& module);
void bind_distributed_scene(nanobind::module_& module);

}  // namespace raydix::python
