// Which of several GPUs a call is about: the one that its memory lies in, as the CUDA runtime says.
// The thread's current GPU is the caller's again after the call.
#pragma once

#include <cuda_runtime.h>

#include <algorithm>
#include <string>
#include <vector>

#include "exec/cuda_error.cuh"

namespace raydix {

/// GPUs on whose default streams this thread has put work while another one was current.
inline std::vector<int>& cuda_devices_to_wait_for() {
    thread_local std::vector<int> devices;
    return devices;
}

/// The GPU that `memory` lies in; the current one for other memory, -1 if there is none.
inline int cuda_device_of(const void* memory) noexcept {
    int device = -1;
    cudaPointerAttributes found{};
    if (cudaGetDevice(&device) != cudaSuccess) {
        device = -1;
    } else if (memory != nullptr && cudaPointerGetAttributes(&found, memory) == cudaSuccess) {
        if (found.type == cudaMemoryTypeDevice) device = found.device;
        return device;
    }
    static_cast<void>(cudaGetLastError());  // of a question, not of a call
    return device;
}

/// Makes the GPU of `memory` current. Returns the one that was, or -1 if nothing changed.
inline int enter_cuda_device(const void* memory) {
    int devices = 0, before = -1;
    if (memory == nullptr) return -1;
    if (cudaGetDeviceCount(&devices) != cudaSuccess || cudaGetDevice(&before) != cudaSuccess) {
        static_cast<void>(cudaGetLastError());  // the call itself says that there is none
        return -1;
    }
    const int device = devices > 1 ? cuda_device_of(memory) : before;
    if (device == before) return -1;
    auto& others = cuda_devices_to_wait_for();
    if (std::find(others.begin(), others.end(), device) == others.end()) others.push_back(device);
    RAYDIX_CUDA_TRY(cudaSetDevice(device));
    return before;
}

inline void leave_cuda_device(int before) noexcept {
    if (before >= 0) static_cast<void>(cudaSetDevice(before));
}

/// The default stream is one of each GPU: all those that this thread's calls may have used.
inline void synchronize_cuda(cudaStream_t stream) {
    std::vector<int> others;
    if (stream == nullptr) others.swap(cuda_devices_to_wait_for());
    RAYDIX_CUDA_TRY(cudaStreamSynchronize(stream));
    if (others.empty()) return;
    int before = 0;
    RAYDIX_CUDA_TRY(cudaGetDevice(&before));
    cudaError_t first = cudaSuccess;
    for (const int device : others) {
        cudaError_t status = cudaSetDevice(device);
        if (status == cudaSuccess) status = cudaStreamSynchronize(nullptr);
        if (first == cudaSuccess) first = status;
    }
    leave_cuda_device(before);
    RAYDIX_CUDA_TRY(first);
}

/// A GPU, and what keeps the library from using it: "" if nothing.
struct CudaFound {
    std::string name, missing;
};

/// The current GPU. `kernel`: any one of this build, which has all for the same architectures,
/// `built`: 900 for sm_90.
inline CudaFound find_cuda_device(const void* kernel, const std::vector<int>& built) {
    int device = 0;
    cudaDeviceProp properties{};
    RAYDIX_CUDA_TRY(cudaGetDevice(&device));
    RAYDIX_CUDA_TRY(cudaGetDeviceProperties(&properties, device));
    CudaFound found{properties.name, ""};
    cudaFuncAttributes attributes{};
    const cudaError_t status = cudaFuncGetAttributes(&attributes, kernel);
    if (status == cudaSuccess) return found;
    if (status != cudaErrorNoKernelImageForDevice && status != cudaErrorInvalidDeviceFunction)
        cuda_failed(status, "cudaFuncGetAttributes", __FILE__, __LINE__);
    static_cast<void>(cudaGetLastError());
    std::string names;
    for (const int architecture : built)
        names += (names.empty() ? "sm_" : ", sm_") + std::to_string(architecture / 10);
    found.missing = "device cuda: " + found.name + " is sm_" + std::to_string(properties.major) +
                    std::to_string(properties.minor) + "; this build has kernels for " + names;
    return found;
}

}  // namespace raydix
