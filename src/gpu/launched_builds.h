// Builds of device_build.h on a stream of any machine.
#pragma once

#include "gpu/device_build.h"
#include "gpu/device_run.h"
#include "gpu/launched_backend.h"

namespace raydix {

template <class Machine>
std::size_t LaunchedBuilds<Machine>::scratch_bytes(std::uint32_t n, const BuildOptions& options) {
    static_cast<void>(this->name());  // says what is missing
    return bvh_scratch_bytes<Machine>(n, options);
}

template <class Machine>
void LaunchedBuilds<Machine>::build(const DeviceMesh& mesh, const BuildOptions& options,
                                    const DeviceTree& tree, Scratch scratch, Stream stream) {
    run_on_stream(machine_, build_of(mesh, options, tree), scratch, stream);
}

template <class Machine>
void LaunchedBuilds<Machine>::build(const DeviceBoxList& boxes, const BuildOptions& options,
                                    const DeviceTree& tree, Scratch scratch, Stream stream) {
    run_on_stream(machine_, build_of(boxes, options, tree), scratch, stream);
}

template <class Machine>
BuildMs LaunchedBuilds<Machine>::time(const DeviceMesh& mesh, const BuildOptions& options,
                                      const DeviceTree& tree, Scratch scratch, Stream stream) {
    return time_on_stream(machine_, build_of(mesh, options, tree), scratch, stream);
}

template <class Machine>
BuildMs LaunchedBuilds<Machine>::time(const DeviceBoxList& boxes, const BuildOptions& options,
                                      const DeviceTree& tree, Scratch scratch, Stream stream) {
    return time_on_stream(machine_, build_of(boxes, options, tree), scratch, stream);
}

}  // namespace raydix
