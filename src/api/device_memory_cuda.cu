// Device memory and streams of raydix/device.h.
#include <raydix/device.h>
#include <raydix/error.h>

#include "exec/cuda_error.cuh"

namespace raydix {

bool device_available() noexcept {
    int devices = 0;
    const bool found = cudaGetDeviceCount(&devices) == cudaSuccess && devices > 0;
    static_cast<void>(cudaGetLastError());  // a missing device is no error of the next call
    return found;
}

std::string device_name() {
    int devices = 0;
    const cudaError_t status = cudaGetDeviceCount(&devices);
    if (status != cudaSuccess || devices == 0) {
        static_cast<void>(cudaGetLastError());
        throw BackendUnavailable(
            std::string("no CUDA device: ") +
            (status == cudaSuccess ? "none found" : cudaGetErrorString(status)));
    }
    int current = 0;
    RAYDIX_CUDA_TRY(cudaGetDevice(&current));
    cudaDeviceProp properties{};
    RAYDIX_CUDA_TRY(cudaGetDeviceProperties(&properties, current));
    return properties.name;
}

void synchronize(Stream stream) {
    RAYDIX_CUDA_TRY(cudaStreamSynchronize(static_cast<cudaStream_t>(stream)));
}

namespace detail {

void* device_allocate(std::size_t bytes) {
    if (bytes == 0) return nullptr;
    static_cast<void>(device_name());
    // Whole lines: byte-wide exchanges work on the word around a byte (base/atomic.h).
    constexpr std::size_t line = 256;
    void* memory = nullptr;
    RAYDIX_CUDA_TRY(cudaMalloc(&memory, (bytes + line - 1) / line * line));
    return memory;
}

void device_free(void* memory) noexcept {
    // An error of an earlier launch that shows up here has been or will be thrown where it is asked
    // for.
    if (memory != nullptr) static_cast<void>(cudaFree(memory));
}

void copy_to_device(void* device, const void* host, std::size_t bytes, Stream stream) {
    if (bytes == 0) return;
    RAYDIX_CUDA_TRY(cudaMemcpyAsync(device, host, bytes, cudaMemcpyHostToDevice,
                                    static_cast<cudaStream_t>(stream)));
}

void copy_to_host(void* host, const void* device, std::size_t bytes, Stream stream) {
    if (bytes == 0) return;
    RAYDIX_CUDA_TRY(cudaMemcpyAsync(host, device, bytes, cudaMemcpyDeviceToHost,
                                    static_cast<cudaStream_t>(stream)));
}

}  // namespace detail
}  // namespace raydix
