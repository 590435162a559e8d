// CUDA as gpu/device_run.h wants a machine.
#pragma once

#include <raydix/device.h>

#include <string_view>
#include <vector>

#include "exec/cuda_launcher.cuh"
#include "gpu/device_run.h"

namespace raydix {

struct CudaMachine;

/// Events at the ends of the stages.
class CudaStageTimes {
public:
    CudaStageTimes(const CudaMachine&, Stream stream) : stream_(static_cast<cudaStream_t>(stream)) {
        (*this)("start");
    }
    CudaStageTimes(const CudaStageTimes&) = delete;
    CudaStageTimes& operator=(const CudaStageTimes&) = delete;
    ~CudaStageTimes() {
        for (const Mark& mark : marks_) static_cast<void>(cudaEventDestroy(mark.event));
    }
    void operator()(const char* stage) {
        Mark mark{stage, nullptr};
        RAYDIX_CUDA_TRY(cudaEventCreate(&mark.event));
        marks_.push_back(mark);
        RAYDIX_CUDA_TRY(cudaEventRecord(mark.event, stream_));
    }
    /// Waits for the last stage.
    [[nodiscard]] BuildMs read() const {
        RAYDIX_CUDA_TRY(cudaEventSynchronize(marks_.back().event));
        BuildMs ms;
        for (std::size_t k = 1; k < marks_.size(); ++k)
            stage_ms(ms, marks_[k].stage) += between(marks_[k - 1], marks_[k]);
        ms.total = between(marks_.front(), marks_.back());
        return ms;
    }

private:
    struct Mark {
        std::string_view stage;
        cudaEvent_t event;
    };
    static double between(const Mark& from, const Mark& to) {
        float ms = 0;
        RAYDIX_CUDA_TRY(cudaEventElapsedTime(&ms, from.event, to.event));
        return ms;
    }
    cudaStream_t stream_;
    std::vector<Mark> marks_;
};

struct CudaMachine {
    using Sizer = CudaSizer;
    using StageTimes = CudaStageTimes;
    static constexpr std::size_t reserved_bytes = CudaLauncher::reserved_bytes;

    [[nodiscard]] CudaLauncher launcher(Stream stream, void* memory, std::size_t bytes) const {
        return {static_cast<cudaStream_t>(stream), memory, bytes};
    }
};

}  // namespace raydix
