// A place on a CUDA stream, and the time between two of them.
#pragma once

#include "exec/cuda_error.cuh"

namespace raydix {

class CudaEvent {
public:
    CudaEvent() { RAYDIX_CUDA_TRY(cudaEventCreate(&event_)); }
    CudaEvent(const CudaEvent&) = delete;
    CudaEvent& operator=(const CudaEvent&) = delete;
    ~CudaEvent() { static_cast<void>(cudaEventDestroy(event_)); }

    void record(void* stream) {
        RAYDIX_CUDA_TRY(cudaEventRecord(event_, static_cast<cudaStream_t>(stream)));
    }
    /// Waits for this one. `start` comes before it on the stream.
    [[nodiscard]] double ms_since(const CudaEvent& start) const {
        RAYDIX_CUDA_TRY(cudaEventSynchronize(event_));
        float ms = 0;
        RAYDIX_CUDA_TRY(cudaEventElapsedTime(&ms, start.event_, event_));
        return ms;
    }

private:
    cudaEvent_t event_ = nullptr;
};

}  // namespace raydix
