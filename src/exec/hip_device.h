// A device of AMD's HIP runtime, with the code object of its architecture and a stream of its own;
// and which devices there are.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "exec/hip_api.h"
#include "exec/kernel_device.h"

namespace raydix {

/// A device as it is found, before it is opened.
struct HipFound {
    int index;
    std::string name, architecture, runtime;  // gfx90a; 6.4
    std::uint32_t compute_units;
};
/// What keeps the library from using it: no code object; "" if nothing.
[[nodiscard]] std::string hip_lacks(const HipFound& found);
/// In the runtime's order. Throws BackendUnavailable: no runtime, no device.
[[nodiscard]] std::vector<HipFound> find_hip_devices();

class HipDevice final : public KernelDevice {
public:
    explicit HipDevice(const HipFound& found);
    /// Waits for its stream. Streams of the caller's must have finished, and memory must be free.
    ~HipDevice() override;
    void close() noexcept override;

    [[nodiscard]] std::string name() const override { return found_.name; }
    [[nodiscard]] std::uint32_t compute_units() const override { return found_.compute_units; }
    /// A hipStream_t of this device.
    [[nodiscard]] Stream queue(Stream given) override;
    [[nodiscard]] void* allocate(std::size_t bytes) override;
    void free(void* memory) noexcept override;
    void copy(Stream queue, void* to, const void* from, std::size_t bytes) override;
    void clear(Stream queue, void* memory, std::size_t bytes) override;
    void launch(Stream queue, const KernelName& kernel, std::size_t groups, std::size_t threads,
                const void* argument, std::size_t bytes) override;
    void finish(Stream queue) override;

private:
    struct Release {
        void operator()(HipModule module) const;
        void operator()(HipStream stream) const;
    };
    [[nodiscard]] HipFunction function(const char* name);

    HipFound found_;
    // What is made later is released first.
    std::unique_ptr<HipModuleHandle, Release> module_;
    std::unique_ptr<HipStreamHandle, Release> own_stream_;
    std::mutex lock_;
    std::map<std::string, HipFunction, std::less<>> functions_;
    std::atomic<bool> closed_ = false;
};

/// Opens the device with this number. Throws BackendUnavailable: there are fewer, or what it lacks.
[[nodiscard]] std::unique_ptr<HipDevice> open_hip_device(std::uint32_t index);

}  // namespace raydix
