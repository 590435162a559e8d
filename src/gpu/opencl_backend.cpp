// OpenCL's rows in the table of backends.
#if defined(RAYDIX_HAVE_OPENCL)

#include "exec/opencl_device.h"
#include "gpu/queue_backend.h"

namespace raydix {
namespace {

OpenclDevice& selected_opencl() {
    auto* backend = dynamic_cast<QueueBackend*>(&device_backend());
    auto* device = backend != nullptr ? dynamic_cast<OpenclDevice*>(&backend->device()) : nullptr;
    if (device == nullptr)
        throw BackendUnavailable("device " + selected_device() + " is selected, not one of OpenCL");
    return *device;
}

}  // namespace

DeviceBackend& opencl_backend(std::uint32_t index) {
    static auto& backends = *new QueueBackends;
    return backends.at("opencl", index, open_opencl_device);
}

void list_opencl_devices(std::vector<DeviceDescription>& out) {
    try {
        const std::vector<OpenclFound> found = find_opencl_devices();
        for (std::size_t k = 0; k < found.size(); ++k) {
            const OpenclTraits& traits = found[k].traits;
            const std::string lacks = opencl_lacks(traits);
            out.push_back({"opencl:" + std::to_string(k), traits.name, traits.driver,
                           lacks.empty() ? "" : "lacks " + lacks});
        }
        if (found.empty()) out.push_back({"opencl", "", "", "no OpenCL device"});
    } catch (const std::exception& error) {
        out.push_back({"opencl", "", "", error.what()});
    }
}

void* opencl_context() { return selected_opencl().context(); }
void* opencl_device_id() { return selected_opencl().id(); }

}  // namespace raydix

#endif
