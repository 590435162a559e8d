// The calls of OpenCL that the library makes. The loader, libOpenCL.so.1, is opened when the first
// of them is asked for, so that a machine without it runs everything else.
#pragma once

#define CL_TARGET_OPENCL_VERSION 300
#include <CL/cl.h>
#include <CL/cl_ext.h>
#include <raydix/error.h>

#include <string>

namespace raydix {

// clang-format off
#define RAYDIX_OPENCL_CALLS(X)                                                                     \
    X(GetPlatformIDs) X(GetPlatformInfo) X(GetDeviceIDs) X(GetDeviceInfo) X(CreateContext)         \
    X(CreateCommandQueueWithProperties) X(ReleaseCommandQueue) X(GetCommandQueueInfo)              \
    X(CreateProgramWithIL) X(BuildProgram) X(GetProgramBuildInfo) X(CreateKernel) X(SetKernelArg)  \
    X(SetKernelExecInfo) X(EnqueueNDRangeKernel) X(Finish) X(GetExtensionFunctionAddressForPlatform)
// clang-format on

struct OpenclApi {
#define RAYDIX_OPENCL_POINTER(name) decltype(&cl##name) name = nullptr;
    RAYDIX_OPENCL_CALLS(RAYDIX_OPENCL_POINTER)
#undef RAYDIX_OPENCL_POINTER
};

/// Throws BackendUnavailable with the text of the system's linker.
[[nodiscard]] const OpenclApi& opencl_api();

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
