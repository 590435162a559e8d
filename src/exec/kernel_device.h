// A device whose kernels have names and one argument each: one of OpenCL (opencl_device.h) or of
// HIP (hip_device.h). What launches pipelines there (queue_launcher.h) knows this much of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace raydix {

using Stream = void*;  // as in raydix/device.h

/// A kernel of a module of SPIR-V. A code object for AMD holds those of all modules.
struct KernelName {
    const char *module, *kernel;
};

class KernelDevice {
public:
    static constexpr std::size_t group_threads = 128;

    KernelDevice() = default;
    KernelDevice(const KernelDevice&) = delete;
    KernelDevice& operator=(const KernelDevice&) = delete;
    virtual ~KernelDevice() = default;

    /// The driver's name for it.
    [[nodiscard]] virtual std::string name() const = 0;
    [[nodiscard]] virtual std::uint32_t compute_units() const = 0;
    /// Whether a processor plays the device.
    [[nodiscard]] virtual bool is_cpu() const { return false; }

    /// The queue that a caller's stream is. Null: the device's own.
    [[nodiscard]] virtual Stream queue(Stream given) = 0;
    /// Aligned to 256 bytes. Throws DeviceError.
    [[nodiscard]] virtual void* allocate(std::size_t bytes) = 0;
    /// Waits for the device's own queue.
    virtual void free(void* memory) noexcept = 0;
    // These are put on a queue that queue() returned. Nothing is waited for.
    virtual void copy(Stream queue, void* to, const void* from, std::size_t bytes) = 0;
    virtual void clear(Stream queue, void* memory, std::size_t bytes) = 0;
    /// `groups` groups of `threads`; the kernel gets the `bytes` at `argument`.
    virtual void launch(Stream queue, const KernelName& kernel, std::size_t groups,
                        std::size_t threads, const void* argument, std::size_t bytes) = 0;
    /// Waits. Throws DeviceError if anything on the queue failed.
    virtual void finish(Stream queue) = 0;
    /// For the end of the process: waits for its queue. From then on free() leaves memory to the
    /// system, because the driver may be gone.
    virtual void close() noexcept = 0;

protected:
    /// From here to note_gone() close() is called when the process ends: the last step of opening.
    void note_open();
    void note_gone() noexcept;
    /// What was asked for last comes first when a process ends, and a driver asks for its own end
    /// when it is loaded and when it first compiles: so this is called after each such step.
    static void close_before_driver();
    /// Whether it computes as the host does (arithmetic_check.h); "" or what is wrong. Runs on its
    /// own queue. Drivers of CPUs compute right and do not claim it: what counts is this.
    [[nodiscard]] std::string wrong_arithmetic();
};

}  // namespace raydix
