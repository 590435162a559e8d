// The module raydix._core: errors, the machine, and what the other files bind.
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <pthread.h>
#include <raydix/error.h>
#include <raydix/machine.h>
#include <raydix/result_limit.h>
#include <raydix/version.h>
#include <raydix/wide.h>

#include <atomic>
#include <cstdint>
#include <string>

#include "batch.h"
#include "bindings.h"
#include "locks.h"

namespace raydix::python {

namespace nb = nanobind;

namespace {

std::atomic<bool> threads_were_started{false};
std::atomic<bool> threads_were_lost{false};

void in_forked_child() {
    Locks::in_forked_child();
    if (threads_were_started) threads_were_lost = true;
}

/// InputError is a ValueError as well: both names can be caught.
void bind_errors(nb::module_& module) {
    nb::exception<InputError>(module, "InputError", PyExc_ValueError).doc() =
        "The input is at fault: a file, a mesh, an option. The message says where and why.";
    nb::exception<BackendUnavailable>(module, "BackendUnavailable", PyExc_RuntimeError).doc() =
        "The call asks for a device or a feature that this build or this machine does not have.";
    nb::exception<DeviceError>(module, "DeviceError", PyExc_RuntimeError).doc() =
        "A call to a device failed. The message holds the driver's text.";
}

void bind_limits(nb::module_& module) {
    module.def(
        "require_result_bytes",
        [](const std::string& what, std::uint64_t bytes, std::uint64_t max_result_bytes) {
            require_result_bytes(what.c_str(), bytes, max_result_bytes);
        },
        nb::arg("what"), nb::arg("bytes"), nb::arg("max_result_bytes"),
        "InputError if a result of so many bytes is more than the limit, or, that being 0, than "
        "half of the memory that is left.");
}

nb::dict machine() {
    const MachineInfo info = machine_info();
    nb::dict fields;
    fields["cpu"] = info.cpu;
    fields["cores"] = info.cores;
    fields["isa"] = info.isa;
    fields["gpu"] = info.gpu;
    return fields;
}

}  // namespace

int threads_for(int asked) {
    constexpr int most = 1024;
    if (asked < 0 || asked > most)
        throw InputError("threads: expected 0 (all of the machine) to " + std::to_string(most) +
                         ", given " + std::to_string(asked));
    if (threads_were_lost) return 1;
    threads_were_started = true;
    return asked;
}

}  // namespace raydix::python

NB_MODULE(_core, module) {
    using namespace raydix::python;
    module.doc() = "The C++ library, array by array. Use the package raydix.";
    pthread_atfork(Locks::before_fork, Locks::after_fork, in_forked_child);
    module.attr("__version__") = raydix::version;
    bind_errors(module);
    bind_limits(module);
    module.def("machine", &machine, "The processor, cores this process may use, instruction set.");
    module.def("simd_instruction_sets", &raydix::simd_instruction_sets,
               "Instruction sets that rays can be traced with here, best first.");
    bind_scene(module);
    bind_points(module);
    bind_device(module);
    bind_pictures(module);
    bind_simulator(module);
    bind_trees(module);
}
