#if defined(RAYDIX_HAVE_HIP)

#include "exec/hip_api.h"

#include <dlfcn.h>

#include <array>

namespace raydix {
namespace {

/// By the name that a ROCm for developers gives it, and those of versions.
void* open_library() {
    std::string fault;
    for (const char* name :
         {"libamdhip64.so", "libamdhip64.so.7", "libamdhip64.so.6", "libamdhip64.so.5"}) {
        if (void* library = dlopen(name, RTLD_NOW | RTLD_LOCAL)) return library;
        if (fault.empty()) fault = dlerror();
    }
    throw BackendUnavailable("device hip: no HIP runtime: " + fault);
}

HipApi open_runtime() {
    void* library = open_library();
    HipApi api;
    const auto find = [&](auto& call, const char* name) {
        call = reinterpret_cast<std::remove_reference_t<decltype(call)>>(dlsym(library, name));
        return call != nullptr;
    };
    const auto need = [&](auto& call, const char* name) {
        if (!find(call, name))
            throw BackendUnavailable(std::string("device hip: libamdhip64.so has no ") + name);
    };
#define RAYDIX_HIP_FIND(name, parameters) need(api.name, "hip" #name);
    RAYDIX_HIP_CALLS(RAYDIX_HIP_FIND)
#undef RAYDIX_HIP_FIND
    need(api.GetErrorString, "hipGetErrorString");
    // The name without a version means the old layout in all versions of the library so far.
    api.architecture_offset = 1160;
    if (!find(api.GetDeviceProperties, "hipGetDevicePropertiesR0600")) {
        api.architecture_offset = 396;
        need(api.GetDeviceProperties, "hipGetDeviceProperties");
    }
    return api;
}

}  // namespace

const HipApi& hip_api() {
    static const HipApi api = open_runtime();  // again after a failure
    return api;
}

std::string hip_status_text(HipStatus status) {
    const char* text = hip_api().GetErrorString(status);
    return (text != nullptr ? std::string(text) : "HIP status") + " (" + std::to_string(status) +
           ")";
}

void hip_try(HipStatus status, const char* call, const std::string& about) {
    if (status != hip_success)
        throw DeviceError(std::string(call) + (about.empty() ? "" : " of " + about) + ": " +
                          hip_status_text(status));
}

}  // namespace raydix

#endif
