// HIP's rows in the table of backends.
#if defined(RAYDIX_HAVE_HIP)

#include "exec/hip_device.h"
#include "gpu/queue_backend.h"

namespace raydix {

DeviceBackend& hip_backend(std::uint32_t index) {
    static auto& backends = *new QueueBackends;
    return backends.at("hip", index, open_hip_device);
}

void list_hip_devices(std::vector<DeviceDescription>& out) {
    try {
        const std::vector<HipFound> found = find_hip_devices();
        for (const HipFound& device : found)
            out.push_back({"hip:" + std::to_string(device.index), device.name,
                           device.architecture + ", HIP " + device.runtime, hip_lacks(device)});
        if (found.empty())
            out.push_back({"hip", "", "", "device hip: the runtime found no device"});
    } catch (const std::exception& error) {
        out.push_back({"hip", "", "", error.what()});
    }
}

}  // namespace raydix

#endif
