// build_bvh_on_device: device_build.h on a CUDA stream.
#include <raydix/device.h>
#include <raydix/error.h>

#include <string>
#include <string_view>
#include <vector>

#include "api/device_build.h"
#include "exec/cuda_launcher.cuh"

namespace raydix {
namespace {

template <class Input>
std::size_t sized(const Input& input, const BuildOptions& options) {
    std::size_t bytes = 0;
    DeviceTree tree;
    tree.pairs = reinterpret_cast<NodePair*>(Arena::alignment);  // the larger case
    with_device_build(input, options, tree, [&](const auto& build) {
        Arena arena = sizing_arena();
        CudaSizer sizer;
        build.run(sizer, arena);
        bytes = arena.bytes() + CudaLauncher::reserved_bytes + sizer.bytes();
    });
    return bytes;
}

template <class Input, class Mark = NoMarks>
void build(const Input& input, const BuildOptions& options, const DeviceTree& tree,
           std::span<std::byte> scratch, Stream stream, const Mark& mark = {}) {
    with_device_build(input, options, tree, [&](const auto& build) {
        Arena layout = sizing_arena();
        CudaSizer sizer;
        build.run(sizer, layout);
        const std::size_t front = layout.bytes();
        const std::size_t needed = front + CudaLauncher::reserved_bytes + sizer.bytes();
        if (scratch.size() < needed)
            throw InputError("the build wants " + std::to_string(needed) +
                             " bytes of scratch on the device; it was given " +
                             std::to_string(scratch.size()));
        if (reinterpret_cast<std::uintptr_t>(scratch.data()) % Arena::alignment != 0)
            throw InputError("the scratch on the device is not aligned to 256 bytes");
        Arena arena(scratch.data(), front);
        CudaLauncher launcher(static_cast<cudaStream_t>(stream), scratch.data() + front,
                              scratch.size() - front);
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

template <class Input>
BuildMs time_build(const Input& input, const BuildOptions& options, const DeviceTree& tree,
                   std::span<std::byte> scratch, Stream stream) {
    StageTimes times(static_cast<cudaStream_t>(stream));
    build(input, options, tree, scratch, stream, [&](const char* stage) { times(stage); });
    return times.read();
}

}  // namespace

std::size_t device_scratch_bytes(std::uint32_t n, const BuildOptions& options) {
    static_cast<void>(device_name());  // says what is missing
    // The kinds of primitives differ in their copies, which are the caller's.
    return sized(DeviceBoxList{nullptr, n}, options);
}

void build_bvh_on_device(const DeviceMesh& mesh, const BuildOptions& options,
                         const DeviceTree& tree, std::span<std::byte> scratch, Stream stream) {
    build(mesh, options, tree, scratch, stream);
}

void build_bvh_on_device(const DeviceBoxList& boxes, const BuildOptions& options,
                         const DeviceTree& tree, std::span<std::byte> scratch, Stream stream) {
    build(boxes, options, tree, scratch, stream);
}

BuildMs time_build_on_device(const DeviceMesh& mesh, const BuildOptions& options,
                             const DeviceTree& tree, std::span<std::byte> scratch, Stream stream) {
    return time_build(mesh, options, tree, scratch, stream);
}

BuildMs time_build_on_device(const DeviceBoxList& boxes, const BuildOptions& options,
                             const DeviceTree& tree, std::span<std::byte> scratch, Stream stream) {
    return time_build(boxes, options, tree, scratch, stream);
}

}  // namespace raydix
