// The warp simulator: launches of rays on simulated machines.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <raydix/simulate.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "arrays.h"
#include "batch.h"
#include "bindings.h"

namespace raydix::python {
namespace {

nb::dict figures(const Simulation& simulation, const SimulateOptions& options) {
    const SimulatedRates rates = simulated_rates(simulation, options);
    nb::dict fields;
    fields["kernel"] = std::string(warp_kernel_name(options.kernel));
    fields["machine"] = options.machine.name;
    fields["rays"] = simulation.rays;
    fields["hits"] = simulation.hits;
    fields["mrays_per_s_bound"] = rates.bound;
    fields["mrays_per_s_scheduled"] = rates.scheduled;
    fields["mrays_per_s_memory"] = options.memory ? nb::cast(rates.memory) : nb::none();
    fields["simd_efficiency"] = rates.simd_efficiency;
    nb::dict issues;
    for (const OperationFigure& operation : simulation.operations)
        issues[nb::cast(std::string(operation.operation))] =
            simulation.rays == 0
                ? 0.0
                : static_cast<double>(operation.issues) / static_cast<double>(simulation.rays);
    fields["issues_per_ray"] = issues;
    fields["instructions"] = simulation.instructions;
    fields["histogram"] = hand_over(
        std::vector<std::uint64_t>(simulation.warp_times.begin(), simulation.warp_times.end()));
    return fields;
}

MachineModel machine_of(const std::string& name) {
    return name.ends_with(".json") ? load_machine_model(name) : machine_model(name);
}

nb::list run(const Bvh& bvh, const RaysIn& rays, const std::vector<std::string>& kernels,
             const nb::bytes& machine, int width, bool any_hit, bool memory, int threads) {
    const MachineModel model = machine_of(path_of(machine));
    std::vector<SimulateOptions> runs;
    for (const std::string& kernel : kernels)
        runs.push_back({.kernel = warp_kernel_from_name(kernel),
                        .machine = model,
                        .width = width,
                        .any_hit = any_hit,
                        .memory = memory});
    nb::list results;
    const auto launch = rows<Ray>(rays);
    const WarpTree tree = [&] {
        const nb::gil_scoped_release unlocked;
        return WarpTree(bvh, std::ranges::any_of(runs, [](const SimulateOptions& run) {
                            return reads_wide_nodes(run.kernel);
                        }));
    }();
    for (const SimulateOptions& options : runs) {  // one at a time, so that signals are heard
        hear_signals();
        std::vector<Simulation> simulated;
        {
            const nb::gil_scoped_release unlocked;
            simulated = simulate(tree, launch, {&options, 1}, nullptr, threads_for(threads));
        }
        results.append(figures(simulated.at(0), options));
    }
    return results;
}

std::vector<std::string> names_of(std::span<const WarpKernel> kernels) {
    std::vector<std::string> names;
    for (const WarpKernel kernel : kernels) names.emplace_back(warp_kernel_name(kernel));
    return names;
}

std::vector<std::string> machine_names() {
    const auto names = machine_model_names();
    return {names.begin(), names.end()};
}

}  // namespace

void bind_simulator(nb::module_& module) {
    module.def("simulate", &run, nb::arg("bvh"), nb::arg("rays").noconvert(), nb::arg("kernels"),
               nb::arg("machine"), nb::arg("width"), nb::arg("any_hit"), nb::arg("memory"),
               nb::arg("threads"));
    module.def(
        "kernels", [] { return names_of(warp_kernels()); },
        "Names of the traversal kernels that can be simulated.");
    module.def(
        "kernel_family", [] { return names_of(warp_kernel_family()); }, "Those of Aila and Laine.");
    module.def("machines", &machine_names, "Names of the simulated machines.");
}

}  // namespace raydix::python
