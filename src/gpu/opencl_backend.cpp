// OpenCL's rows in the table of backends: devices, their memory and their queues.
#if defined(RAYDIX_HAVE_OPENCL)

#include "gpu/opencl_backend.h"

#include <algorithm>
#include <map>
#include <mutex>

namespace raydix {
namespace {

OpenclBackend& selected_opencl() {
    auto* backend = dynamic_cast<OpenclBackend*>(&device_backend());
    if (backend == nullptr)
        throw BackendUnavailable("device " + selected_device() + " is selected, not one of OpenCL");
    return *backend;
}

}  // namespace

std::string OpenclBackend::name() {
    return device_->traits().name + (device_->is_cpu() ? " (OpenCL on a CPU)" : "");
}

void OpenclBackend::synchronize(Stream stream) { device_->finish(device_->queue(stream)); }

void* OpenclBackend::allocate(std::size_t bytes) { return device_->allocate(bytes); }

void OpenclBackend::free(void* memory) noexcept { device_->free(memory); }

void OpenclBackend::copy_to_device(void* device, const void* host, std::size_t bytes,
                                   Stream stream) {
    device_->copy(device_->queue(stream), device, host, bytes);
}

void OpenclBackend::copy_to_host(void* host, const void* device, std::size_t bytes, Stream stream) {
    device_->copy(device_->queue(stream), host, device, bytes);
}

double OpenclBackend::measure_copy(std::size_t bytes, int repeat) {
    const DeviceBuffer<std::byte> from(bytes), to(bytes);
    cl_command_queue queue = device_->queue(nullptr);
    double best = 0;
    for (int turn = 0; turn <= repeat; ++turn) {
        const double start = opencl_clock_ms();
        device_->copy(queue, to.data(), from.data(), bytes);
        device_->finish(queue);
        const double ms = opencl_clock_ms() - start;
        if (turn > 0) best = std::max(best, 2.0 * static_cast<double>(bytes) / (1e-3 * ms));
    }
    return best;
}

DeviceBackend& opencl_backend(std::uint32_t index) {
    static std::mutex lock;
    // Never destroyed: at the end of the process the driver may be gone before they are.
    static auto& backends = *new std::map<std::uint32_t, std::unique_ptr<OpenclBackend>>;
    const std::lock_guard guard(lock);
    std::unique_ptr<OpenclBackend>& backend = backends[index];
    if (backend == nullptr)
        backend = std::make_unique<OpenclBackend>(index, open_opencl_device(index));
    return *backend;
}

void list_opencl_devices(std::vector<DeviceDescription>& out) {
    try {
        const std::vector<OpenclFound> found = find_opencl_devices();
        for (std::size_t k = 0; k < found.size(); ++k) {
            const OpenclTraits& traits = found[k].traits;
            const std::string lacks = opencl_lacks(traits);
            out.push_back({"opencl:" + std::to_string(k), traits.name, traits.driver,
                           lacks.empty() ? "" : "lacks " + lacks});
        }
        if (found.empty()) out.push_back({"opencl", "", "", "no OpenCL device"});
    } catch (const std::exception& error) {
        out.push_back({"opencl", "", "", error.what()});
    }
}

void* opencl_context() { return selected_opencl().device().context(); }
void* opencl_device_id() { return selected_opencl().device().id(); }

}  // namespace raydix

#endif
