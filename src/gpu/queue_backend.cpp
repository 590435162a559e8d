// Devices with queues, OpenCL's and HIP's: their memory and their queues.
#if defined(RAYDIX_HAVE_QUEUES)

#include "gpu/queue_backend.h"

#include <algorithm>

namespace raydix {

std::string QueueBackend::name() {
    return device_->name() + (device_->is_cpu() ? " (OpenCL on a CPU)" : "");
}

void QueueBackend::synchronize(Stream stream) { device_->finish(device_->queue(stream)); }

void* QueueBackend::allocate(std::size_t bytes) { return device_->allocate(bytes); }

void QueueBackend::free(void* memory) noexcept { device_->free(memory); }

void QueueBackend::copy_to_device(void* device, const void* host, std::size_t bytes,
                                  Stream stream) {
    device_->copy(device_->queue(stream), device, host, bytes);
}

void QueueBackend::copy_to_host(void* host, const void* device, std::size_t bytes, Stream stream) {
    device_->copy(device_->queue(stream), host, device, bytes);
}

double QueueBackend::measure_copy(std::size_t bytes, int repeat) {
    const DeviceBuffer<std::byte> from(bytes), to(bytes);
    const Stream queue = device_->queue(nullptr);
    double best = 0;
    for (int turn = 0; turn <= repeat; ++turn) {
        const double start = queue_clock_ms();
        device_->copy(queue, to.data(), from.data(), bytes);
        device_->finish(queue);
        const double ms = queue_clock_ms() - start;
        if (turn > 0) best = std::max(best, 2.0 * static_cast<double>(bytes) / (1e-3 * ms));
    }
    return best;
}

}  // namespace raydix

#endif
