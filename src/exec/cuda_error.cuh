// Failed calls of the CUDA runtime become DeviceError, once: the thread's last error is cleared, so
// that the next launch, which asks for it, does not throw what has been thrown.
#pragma once

#include <cuda_runtime.h>
#include <raydix/error.h>

#include <string>

namespace raydix {

[[noreturn]] inline void cuda_failed(cudaError_t status, const char* expression, const char* file,
                                     int line) {
    static_cast<void>(cudaGetLastError());
    throw DeviceError(std::string(expression) + " at " + file + ":" + std::to_string(line) + ": " +
                      cudaGetErrorName(status) + ": " + cudaGetErrorString(status));
}

}  // namespace raydix

#define RAYDIX_CUDA_TRY(expression)                                                \
    do {                                                                           \
        const cudaError_t raydix_status = (expression);                            \
        if (raydix_status != cudaSuccess)                                          \
            ::raydix::cuda_failed(raydix_status, #expression, __FILE__, __LINE__); \
    } while (false)
