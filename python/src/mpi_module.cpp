// The module raydix._mpi: points and scenes over the ranks of MPI. It has the communicators of
// mpi4py by number; both must use one MPI library.
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <raydix/error.h>

#include <exception>
#include <string>
#include <tuple>

#include "mpi_bindings.h"

namespace raydix::python {

namespace nb = nanobind;

namespace {

/// Errors of this module's copy of the library become those of raydix._core.
void translate(const std::exception_ptr& error, void*) {
    const auto raise = [](const char* name, const std::exception& raised) {
        PyErr_SetString(nb::module_::import_("raydix._core").attr(name).ptr(), raised.what());
    };
    try {
        std::rethrow_exception(error);
    } catch (const InputError& e) {
        raise("InputError", e);
    } catch (const BackendUnavailable& e) {
        raise("BackendUnavailable", e);
    }
}

/// Of the MPI library that this module found, which works before MPI is started.
std::string library() {
    char text[MPI_MAX_LIBRARY_VERSION_STRING] = {};
    int length = 0;
    MPI_Get_library_version(text, &length);
    return {text, static_cast<std::size_t>(length)};
}

bool is_running() {
    int started = 0, ended = 0;
    MPI_Initialized(&started);
    MPI_Finalized(&ended);
    return started != 0 && ended == 0;
}

}  // namespace

void set_options(mpi::Options& options, const OptionValues& values) {
    bool is_curve = false;
    std::tie(is_curve, options.strict, options.threads, options.exchange_bytes,
             options.message_bytes, options.boxes_per_rank) = values;
    options.partition = is_curve ? mpi::Partition::curve : mpi::Partition::as_given;
}

nb::dict figures_of(const mpi::CallReport& report) {
    nb::dict figures;
    figures["rounds"] = report.rounds;
    figures["questions"] = report.questions;
    figures["answered"] = report.answered;
    figures["messages"] = report.traffic.messages;
    figures["bytes"] = report.traffic.bytes;
    figures["collectives"] = report.traffic.collectives;
    figures["compute_seconds"] = report.compute_seconds;
    return figures;
}

nb::dict figures_of(const mpi::Holding& holding) {
    nb::dict figures;
    figures["size"] = holding.size;
    figures["left_out"] = holding.left_out;
    figures["local"] = holding.local;
    figures["first"] = holding.first;
    figures["paths"] = holding.paths;
    figures["first_path"] = holding.first_path;
    figures["replicated_bytes"] = holding.replicated_bytes;
    figures["bytes"] = holding.bytes;
    figures["report"] = figures_of(holding.report);
    return figures;
}

}  // namespace raydix::python

NB_MODULE(_mpi, module) {
    using namespace raydix::python;
    module.doc() = "The C++ library over MPI, array by array. Use raydix.mpi.";
    nb::register_exception_translator(translate, nullptr);
    nb::exception<raydix::mpi::CommunicationError>(module, "CommunicationError", PyExc_RuntimeError)
        .doc() = "MPI itself failed. The message names the MPI call.";
    module.def("library", &library);
    module.def("is_running", &is_running);
    bind_distributed_points(module);
    bind_distributed_scene(module);
}
