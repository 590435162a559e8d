// A build as launches on a CUDA stream: its scratch, its launches, its times. `with`
// calls its argument with the build, whose run(launcher, arena, mark) is the pipeline.
#pragma once

#include <raydix/device.h>
#include <raydix/error.h>

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "exec/cuda_launcher.cuh"
#include "gpu/device_sorted.h"

namespace raydix {

/// Bytes of the arrays, and in all.
struct ScratchSize {
    std::size_t front = 0, all = 0;
};

template <class With>
ScratchSize scratch_size(const With& with) {
    ScratchSize size;
    with([&](const auto& build) {
        Arena arena = sizing_arena();
        CudaSizer sizer;
        build.run(sizer, arena);
        size.front = arena.bytes();
        size.all = size.front + CudaLauncher::reserved_bytes + sizer.bytes();
    });
    return size;
}

template <class With, class Mark = NoMarks>
void run_on_stream(const With& with, std::span<std::byte> scratch, Stream stream,
                   const Mark& mark = {}) {
    const ScratchSize size = scratch_size(with);
    if (scratch.size() < size.all)
        throw InputError("the build wants " + std::to_string(size.all) +
                         " bytes of scratch on the device; it was given " +
                         std::to_string(scratch.size()));
    if (reinterpret_cast<std::uintptr_t>(scratch.data()) % Arena::alignment != 0)
        throw InputError("the scratch on the device is not aligned to 256 bytes");
    with([&](const auto& build) {
        Arena arena(scratch.data(), size.front);
        CudaLauncher launcher(static_cast<cudaStream_t>(stream), scratch.data() + size.front,
                              scratch.size() - size.front);
        build.run(launcher, arena, mark);
    });
}

/// Events at the ends of the stages.
class StageTimes {
public:
    explicit StageTimes(cudaStream_t stream) : stream_(stream) { (*this)("start"); }
    StageTimes(const StageTimes&) = delete;
    StageTimes& operator=(const StageTimes&) = delete;
    ~StageTimes() {
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
            field(ms, marks_[k].stage) += between(marks_[k - 1], marks_[k]);
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
    static double& field(BuildMs& ms, std::string_view stage) {
        if (stage == "bounds") return ms.bounds;
        if (stage == "codes") return ms.codes;
        if (stage == "sort") return ms.sort;
        if (stage == "hierarchy") return ms.hierarchy;
        if (stage == "fit") return ms.fit;
        return ms.layout;
    }

    cudaStream_t stream_;
    std::vector<Mark> marks_;
};

/// Waits for the end.
template <class With>
BuildMs time_on_stream(const With& with, std::span<std::byte> scratch, Stream stream) {
    StageTimes times(static_cast<cudaStream_t>(stream));
    run_on_stream(with, scratch, stream, [&](const char* stage) { times(stage); });
    return times.read();
}

}  // namespace raydix
