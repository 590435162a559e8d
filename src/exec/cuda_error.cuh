// Failed calls of the CUDA runtime become DeviceError.
#pragma once

#include <cuda_runtime.h>
#include <raydix/error.h>

#include <string>

namespace raydix {

[[noreturn]] inline void cuda_failed(cudaError_t status, const char* expression, const char* file,
                                     int line) {
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
