// The table of backends, and which of them a thread has selected.
#include "gpu/backend.h"

#include <array>
#include <charconv>
#include <optional>
#include <system_error>

namespace raydix {
namespace {

thread_local DeviceBackend* selected = nullptr;

/// Kinds of devices that have numbers.
struct Numbered {
    std::string_view kind;
    DeviceBackend& (*backend)(std::uint32_t index);
};
constexpr std::array numbered = {Numbered{"opencl", opencl_backend}, Numbered{"hip", hip_backend}};

/// The N of "opencl:N"; "opencl" alone is the first. Nothing if it is another word.
std::optional<std::uint32_t> index_of(std::string_view kind, std::string_view selector) {
    if (!selector.starts_with(kind)) return {};
    const std::string_view rest = selector.substr(kind.size());
    if (rest.empty()) return 0;
    if (rest[0] != ':') return {};
    std::uint32_t index = 0;
    const char* end = rest.data() + rest.size();
    const auto [after, error] = std::from_chars(rest.data() + 1, end, index);
    if (error != std::errc() || after != end) return {};
    return index;
}

DeviceBackend& backend_of(std::string_view selector) {
    if (selector == "cuda") return cuda_backend();
    for (const Numbered& row : numbered)
        if (const auto index = index_of(row.kind, selector)) return row.backend(*index);
    throw InputError("device " + std::string(selector) +
                     "; it must be cuda, opencl, opencl:N, hip or hip:N");
}

}  // namespace

DeviceBackend& device_backend() { return selected != nullptr ? *selected : cuda_backend(); }

void select_device(std::string_view selector) {
    DeviceBackend& backend = backend_of(selector);
    static_cast<void>(backend.name());  // says if there is no device
    selected = &backend;
}

std::string selected_device() { return device_backend().selector(); }

std::vector<DeviceDescription> list_devices() {
    std::vector<DeviceDescription> all;
    list_cuda_devices(all);
    list_opencl_devices(all);
    list_hip_devices(all);
    return all;
}

}  // namespace raydix
