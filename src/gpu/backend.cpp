// The table of backends, and which of them a thread has selected.
#include "gpu/backend.h"

#include <charconv>

namespace raydix {
namespace {

thread_local DeviceBackend* selected = nullptr;

/// The N of "opencl:N"; "opencl" alone is the first.
std::uint32_t opencl_index(std::string_view selector) {
    constexpr std::string_view kind = "opencl";
    if (selector == kind) return 0;
    std::uint32_t index = 0;
    const char* end = selector.data() + selector.size();
    const char* first = selector.data() + kind.size() + 1;
    if (!selector.starts_with("opencl:") || first == end ||
        std::from_chars(first, end, index).ptr != end)
        throw InputError("device " + std::string(selector) +
                         "; it must be cuda, opencl or opencl:N");
    return index;
}

}  // namespace

DeviceBackend& device_backend() { return selected != nullptr ? *selected : cuda_backend(); }

void select_device(std::string_view selector) {
    if (selector == "cuda") {
        static_cast<void>(cuda_backend().name());
        selected = &cuda_backend();
    } else {
        selected = &opencl_backend(opencl_index(selector));
    }
}

std::string selected_device() { return device_backend().selector(); }

std::vector<DeviceDescription> list_devices() {
    std::vector<DeviceDescription> all;
    list_cuda_devices(all);
    list_opencl_devices(all);
    return all;
}

}  // namespace raydix
