// CUDA as gpu/device_run.h wants a machine.
#pragma once

#include <raydix/device.h>

#include <deque>
#include <string_view>

#include "exec/cuda_event.cuh"
#include "exec/cuda_launcher.cuh"
#include "gpu/cuda_backend.h"
#include "gpu/device_run.h"

namespace raydix {

static_assert(CudaMachine::reserved_bytes == CudaLauncher::reserved_bytes);

inline CudaLauncher CudaMachine::launcher(Stream stream, void* memory, std::size_t bytes) const {
    return {static_cast<cudaStream_t>(stream), memory, bytes};
}

/// Events at the ends of the stages.
class CudaStageTimes {
public:
    CudaStageTimes(const CudaMachine&, Stream stream) : stream_(stream) { (*this)("start"); }
    void operator()(const char* stage) {
        marks_.emplace_back().stage = stage;
        marks_.back().event.record(stream_);
    }
    /// Waits for the last stage.
    [[nodiscard]] BuildMs read() const {
        BuildMs ms;
        ms.total = marks_.back().event.ms_since(marks_.front().event);
        for (std::size_t k = 1; k < marks_.size(); ++k)
            stage_ms(ms, marks_[k].stage) += marks_[k].event.ms_since(marks_[k - 1].event);
        return ms;
    }

private:
    struct Mark {
        std::string_view stage;
        CudaEvent event;
    };
    Stream stream_;
    std::deque<Mark> marks_;
};

}  // namespace raydix
