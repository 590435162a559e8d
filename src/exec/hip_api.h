// The calls of AMD's HIP runtime that the library makes, declared here: nothing of ROCm is needed
// to build. The runtime, libamdhip64.so, is opened when the first of them is asked for.
#pragma once

#include <raydix/error.h>

#include <cstddef>
#include <string>

namespace raydix {

// Of hip_runtime_api.h, ROCm 5.0 to 7.0: statuses and handles, and the numbers that have kept their
// meaning through those versions.
using HipStatus = int;
struct HipStreamHandle;
struct HipModuleHandle;
struct HipFunctionHandle;
using HipStream = HipStreamHandle*;
using HipModule = HipModuleHandle*;
using HipFunction = HipFunctionHandle*;

inline constexpr HipStatus hip_success = 0, hip_no_device = 100;
inline constexpr int hip_multiprocessor_count = 63;  // of hipDeviceAttribute_t
inline constexpr int hip_memcpy_default = 4;         // hipMemcpyDefault: found out by the pointers
inline constexpr unsigned hip_stream_non_blocking = 1;
/// Of a launch that gives its arguments as bytes: HIP_LAUNCH_PARAM_BUFFER_POINTER and so on.
enum class HipLaunchParameter : std::size_t { buffer_pointer = 1, buffer_size = 2, end = 3 };

// clang-format off
#define RAYDIX_HIP_CALLS(X)                                                                        \
    X(Init, (unsigned flags))                                                                      \
    X(RuntimeGetVersion, (int* version))                                                           \
    X(GetDeviceCount, (int* count))                                                                \
    X(GetDevice, (int* device))                                                                    \
    X(SetDevice, (int device))                                                                     \
    X(DeviceGetName, (char* name, int bytes, int device))                                          \
    X(DeviceGetAttribute, (int* value, int attribute, int device))                                 \
    X(ModuleLoadData, (HipModule* module, const void* image))                                      \
    X(ModuleUnload, (HipModule module))                                                            \
    X(ModuleGetFunction, (HipFunction* function, HipModule module, const char* name))              \
    X(ModuleLaunchKernel, (HipFunction function, unsigned grid_x, unsigned grid_y,                 \
        unsigned grid_z, unsigned block_x, unsigned block_y, unsigned block_z, unsigned shared,    \
        HipStream stream, void** arguments, void** extra))                                         \
    X(Malloc, (void** memory, std::size_t bytes))                                                  \
    X(Free, (void* memory))                                                                        \
    X(MemcpyAsync, (void* to, const void* from, std::size_t bytes, int kind, HipStream stream))    \
    X(MemsetAsync, (void* memory, int value, std::size_t bytes, HipStream stream))                 \
    X(StreamCreateWithFlags, (HipStream* stream, unsigned flags))                                  \
    X(StreamSynchronize, (HipStream stream))                                                       \
    X(StreamDestroy, (HipStream stream))
// clang-format on

struct HipApi {
#define RAYDIX_HIP_POINTER(name, parameters) HipStatus(*name) parameters = nullptr;
    RAYDIX_HIP_CALLS(RAYDIX_HIP_POINTER)
#undef RAYDIX_HIP_POINTER
    const char* (*GetErrorString)(HipStatus) = nullptr;
    /// Fills hipDeviceProp_t, whose layout changed with ROCm 6.0; the function's name tells which.
    HipStatus (*GetDeviceProperties)(void* properties, int device) = nullptr;
    std::size_t architecture_offset = 0;  // of gcnArchName in there
};

/// Throws BackendUnavailable with the text of the system's linker.
[[nodiscard]] const HipApi& hip_api();

/// Throws DeviceError: the call, what it was about, the runtime's text.
void hip_try(HipStatus status, const char* call, const std::string& about = {});
/// The runtime's text for a status, with its number.
[[nodiscard]] std::string hip_status_text(HipStatus status);

}  // namespace raydix
