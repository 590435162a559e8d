#if defined(RAYDIX_HAVE_OPENCL)

#include "exec/opencl_api.h"

#include <dlfcn.h>

#include <array>
#include <mutex>
#include <utility>

namespace raydix {
namespace {

OpenclApi open_loader() {
    void* library = dlopen("libOpenCL.so.1", RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr)
        throw BackendUnavailable(std::string("device opencl: no OpenCL loader: ") + dlerror());
    OpenclApi api;
    const auto find = [&](auto& call, const char* name) {
        call = reinterpret_cast<std::remove_reference_t<decltype(call)>>(dlsym(library, name));
        if (call == nullptr)
            throw BackendUnavailable(
                std::string("device opencl: libOpenCL.so.1 is older than OpenCL 2.1: it has no ") +
                name);
    };
#define RAYDIX_OPENCL_FIND(name) find(api.name, "cl" #name);
    RAYDIX_OPENCL_CALLS(RAYDIX_OPENCL_FIND)
#undef RAYDIX_OPENCL_FIND
    return api;
}

std::mutex& notes_lock() {
    static std::mutex lock;
    return lock;
}
std::string& last_note() {
    static auto& text = *new std::string;  // never destroyed: drivers may speak at their end
    return text;
}

}  // namespace

const OpenclApi& opencl_api() {
    static const OpenclApi api = open_loader();  // again after a failure
    return api;
}

std::string opencl_status_name(cl_int status) {
    static constexpr std::array names = {
        std::pair{CL_DEVICE_NOT_FOUND, "CL_DEVICE_NOT_FOUND"},
        std::pair{CL_DEVICE_NOT_AVAILABLE, "CL_DEVICE_NOT_AVAILABLE"},
        std::pair{CL_MEM_OBJECT_ALLOCATION_FAILURE, "CL_MEM_OBJECT_ALLOCATION_FAILURE"},
        std::pair{CL_OUT_OF_RESOURCES, "CL_OUT_OF_RESOURCES"},
        std::pair{CL_OUT_OF_HOST_MEMORY, "CL_OUT_OF_HOST_MEMORY"},
        std::pair{CL_BUILD_PROGRAM_FAILURE, "CL_BUILD_PROGRAM_FAILURE"},
        std::pair{CL_INVALID_VALUE, "CL_INVALID_VALUE"},
        std::pair{CL_INVALID_DEVICE, "CL_INVALID_DEVICE"},
        std::pair{CL_INVALID_CONTEXT, "CL_INVALID_CONTEXT"},
        std::pair{CL_INVALID_COMMAND_QUEUE, "CL_INVALID_COMMAND_QUEUE"},
        std::pair{CL_INVALID_BINARY, "CL_INVALID_BINARY"},
        std::pair{CL_INVALID_BUILD_OPTIONS, "CL_INVALID_BUILD_OPTIONS"},
        std::pair{CL_INVALID_KERNEL_NAME, "CL_INVALID_KERNEL_NAME"},
        std::pair{CL_INVALID_ARG_SIZE, "CL_INVALID_ARG_SIZE"},
        std::pair{CL_INVALID_KERNEL_ARGS, "CL_INVALID_KERNEL_ARGS"},
        std::pair{CL_INVALID_WORK_GROUP_SIZE, "CL_INVALID_WORK_GROUP_SIZE"},
        std::pair{CL_INVALID_OPERATION, "CL_INVALID_OPERATION"},
        std::pair{CL_INVALID_BUFFER_SIZE, "CL_INVALID_BUFFER_SIZE"},
        std::pair{CL_PLATFORM_NOT_FOUND_KHR, "CL_PLATFORM_NOT_FOUND_KHR"},
    };
    for (const auto& [value, name] : names)
        if (value == status) return std::string(name) + " (" + std::to_string(status) + ")";
    return "OpenCL status " + std::to_string(status);
}

void CL_CALLBACK OpenclNotes::note(const char* text, const void*, std::size_t, void*) {
    const std::lock_guard lock(notes_lock());
    last_note() = text;
}

std::string OpenclNotes::take() {
    const std::lock_guard lock(notes_lock());
    return std::exchange(last_note(), {});
}

void opencl_failed(cl_int status, const char* call, const std::string& about) {
    const std::string note = OpenclNotes::take();
    throw DeviceError(std::string(call) + (about.empty() ? "" : " of " + about) + ": " +
                      opencl_status_name(status) + (note.empty() ? "" : ": " + note));
}

}  // namespace raydix

#endif
