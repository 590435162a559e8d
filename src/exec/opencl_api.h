// The calls of OpenCL that the library makes. The loader, libOpenCL.so.1, is opened when the first
// of them is asked for, so that a machine without it runs everything else.
#pragma once

#define CL_TARGET_OPENCL_VERSION 300
#include <CL/cl.h>
#include <CL/cl_ext.h>
#include <raydix/error.h>

#include <string>
#include <utility>

namespace raydix {

// clang-format off
#define RAYDIX_OPENCL_CALLS(X)                                                                     \
    X(GetPlatformIDs) X(GetPlatformInfo) X(GetDeviceIDs) X(GetDeviceInfo) X(CreateContext)         \
    X(ReleaseContext) X(CreateCommandQueueWithProperties) X(ReleaseCommandQueue)                   \
    X(GetCommandQueueInfo) X(CreateProgramWithIL) X(BuildProgram) X(GetProgramBuildInfo)           \
    X(ReleaseProgram) X(CreateKernel) X(ReleaseKernel) X(SetKernelArg) X(SetKernelExecInfo)        \
    X(EnqueueNDRangeKernel) X(Finish) X(GetExtensionFunctionAddressForPlatform)
// clang-format on

struct OpenclApi {
#define RAYDIX_OPENCL_POINTER(name) decltype(&cl##name) name = nullptr;
    RAYDIX_OPENCL_CALLS(RAYDIX_OPENCL_POINTER)
#undef RAYDIX_OPENCL_POINTER
};

/// Throws BackendUnavailable with the text of the system's linker.
[[nodiscard]] const OpenclApi& opencl_api();

/// A context, queue, program or kernel, released once.
template <class Handle, auto Release>
class OpenclOwned {
public:
    OpenclOwned() = default;
    explicit OpenclOwned(Handle handle) : handle_(handle) {}
    OpenclOwned(OpenclOwned&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
    OpenclOwned& operator=(OpenclOwned&& other) noexcept {
        std::swap(handle_, other.handle_);
        return *this;
    }
    ~OpenclOwned() {
        if (handle_ != nullptr) static_cast<void>((opencl_api().*Release)(handle_));
    }
    [[nodiscard]] Handle get() const { return handle_; }

private:
    Handle handle_ = nullptr;
};
using OpenclContext = OpenclOwned<cl_context, &OpenclApi::ReleaseContext>;
using OpenclQueue = OpenclOwned<cl_command_queue, &OpenclApi::ReleaseCommandQueue>;
using OpenclProgram = OpenclOwned<cl_program, &OpenclApi::ReleaseProgram>;
using OpenclKernel = OpenclOwned<cl_kernel, &OpenclApi::ReleaseKernel>;

/// The name that OpenCL gives a status, with its number.
[[nodiscard]] std::string opencl_status_name(cl_int status);

/// What a driver says in a context's own words goes here, for the error that follows.
class OpenclNotes {
public:
    static void CL_CALLBACK note(const char* text, const void*, std::size_t, void*);
    /// The last text since it was asked for.
    [[nodiscard]] static std::string take();
};

[[noreturn]] void opencl_failed(cl_int status, const char* call, const std::string& about);

/// Throws DeviceError: the call, what it was about, the status, the driver's text.
inline void opencl_try(cl_int status, const char* call, const std::string& about = {}) {
    if (status != CL_SUCCESS) opencl_failed(status, call, about);
}

}  // namespace raydix
