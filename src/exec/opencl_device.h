// An OpenCL device with its context, its programs and its own queue; and which devices there are.
// Memory is that of cl_intel_unified_shared_memory, whose pointers are as good inside of a functor
// as they are as a kernel's argument.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "exec/kernel_device.h"
#include "exec/opencl_api.h"

namespace raydix {

/// What a device says of itself, as far as the library depends on it.
struct OpenclTraits {
    std::string name, driver, il_versions, extensions;
    cl_device_fp_config single_precision = 0, double_precision = 0;
    cl_device_atomic_capabilities atomics = 0;
    std::vector<std::size_t> sub_group_sizes;
    std::size_t work_group_size = 0;
    std::uint64_t local_memory = 0;
    cl_uint address_bits = 0, compute_units = 0;
    bool available = false, generic_pointers = false;
};
/// What of the above a device lacks; "" if nothing.
[[nodiscard]] std::string opencl_lacks(const OpenclTraits& traits);

/// A module of kernels that the driver did not compile. Throws BackendUnavailable if it refuses the
/// one option, correctly rounded division and square roots; else DeviceError.
[[noreturn]] void opencl_build_failed(cl_int status, const std::string& device,
                                      const std::string& about);

/// A device as it is found, before it is opened.
struct OpenclFound {
    cl_platform_id platform;
    cl_device_id device;
    OpenclTraits traits;
};
/// Those of all platforms, in the loader's order. Throws BackendUnavailable: no loader, no driver.
[[nodiscard]] std::vector<OpenclFound> find_opencl_devices();

class OpenclDevice final : public KernelDevice {
public:
    explicit OpenclDevice(const OpenclFound& found);
    /// Waits for its queue. Queues of the caller's must have finished, and memory must be free.
    ~OpenclDevice() override;
    void close() noexcept override;

    [[nodiscard]] cl_context context() const { return context_.get(); }
    [[nodiscard]] cl_device_id id() const { return device_; }

    [[nodiscard]] std::string name() const override { return traits_.name; }
    [[nodiscard]] std::uint32_t compute_units() const override { return traits_.compute_units; }
    [[nodiscard]] bool is_cpu() const override { return is_cpu_; }
    /// A cl_command_queue. Throws InputError: a queue of another context or device, or one that may
    /// change the order of launches.
    [[nodiscard]] Stream queue(Stream given) override;

    [[nodiscard]] void* allocate(std::size_t bytes) override;
    void free(void* memory) noexcept override;
    void copy(Stream queue, void* to, const void* from, std::size_t bytes) override;
    void clear(Stream queue, void* memory, std::size_t bytes) override;
    /// The program of its module is built when the first of its kernels is asked for.
    void launch(Stream queue, const KernelName& kernel, std::size_t groups, std::size_t threads,
                const void* argument, std::size_t bytes) override;
    void finish(Stream queue) override;

private:
    [[nodiscard]] cl_command_queue own_queue() const { return own_queue_.get(); }
    [[nodiscard]] cl_program program(const char* module);
    [[nodiscard]] cl_kernel kernel(const KernelName& name);

    cl_platform_id platform_;
    cl_device_id device_;
    OpenclTraits traits_;
    bool is_cpu_ = false;
    // What is made later is released first.
    OpenclContext context_;
    OpenclQueue own_queue_;
    clDeviceMemAllocINTEL_fn allocate_ = nullptr;
    clMemBlockingFreeINTEL_fn free_ = nullptr;
    clEnqueueMemcpyINTEL_fn copy_ = nullptr;
    clEnqueueMemFillINTEL_fn fill_ = nullptr;
    std::mutex lock_;  // an argument that is set belongs to the next launch of its kernel
    std::map<std::string, OpenclProgram, std::less<>> programs_;
    std::map<std::string, OpenclKernel, std::less<>> kernels_;
    std::atomic<bool> closed_ = false;
};

/// Opens the device with this number. Throws BackendUnavailable: there are fewer, or what it lacks.
[[nodiscard]] std::unique_ptr<OpenclDevice> open_opencl_device(std::uint32_t index);

}  // namespace raydix
