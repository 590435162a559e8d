// CUDA's row in the table of backends: the device, its memory and its streams.
#include <raydix/device.h>
#include <raydix/error.h>

#include <algorithm>
#include <map>
#include <mutex>

#include "exec/cuda_device.cuh"
#include "exec/cuda_event.cuh"
#include "gpu/cuda_backend.h"

namespace raydix {
namespace {

__global__ void any_kernel() {}

/// The current GPU, asked once: properties take long, and a kernel is loaded.
CudaFound found_device() {
    static std::mutex lock;
    static std::map<int, CudaFound> known;
    int device = 0;
    RAYDIX_CUDA_TRY(cudaGetDevice(&device));
    const std::lock_guard guard(lock);
    const auto at = known.find(device);
    if (at != known.end()) return at->second;
    const void* kernel = reinterpret_cast<const void*>(any_kernel);
    return known.emplace(device, find_cuda_device(kernel, {__CUDA_ARCH_LIST__})).first->second;
}

}  // namespace

std::string CudaBackend::name() {
    int devices = 0;
    const cudaError_t status = cudaGetDeviceCount(&devices);
    if (status != cudaSuccess || devices == 0) {
        static_cast<void>(cudaGetLastError());
        throw BackendUnavailable(
            std::string("no CUDA device: ") +
            (status == cudaSuccess ? "none found" : cudaGetErrorString(status)));
    }
    const CudaFound found = found_device();
    if (!found.missing.empty()) throw BackendUnavailable(found.missing);
    return found.name;
}

int CudaBackend::enter(const void* memory) { return enter_cuda_device(memory); }
void CudaBackend::leave(int before) noexcept { leave_cuda_device(before); }
int CudaBackend::current() { return cuda_device_of(nullptr); }

void CudaBackend::synchronize(Stream stream) {
    synchronize_cuda(static_cast<cudaStream_t>(stream));
}

double CudaBackend::measure_copy(std::size_t bytes, int repeat) {
    const DeviceBuffer<std::byte> from(bytes), to(bytes);
    CudaEvent start, stop;
    double best = 0;
    for (int turn = 0; turn <= repeat; ++turn) {
        start.record(nullptr);
        RAYDIX_CUDA_TRY(cudaMemcpyAsync(to.data(), from.data(), bytes, cudaMemcpyDeviceToDevice));
        stop.record(nullptr);
        const double ms = stop.ms_since(start);
        if (turn > 0) best = std::max(best, 2.0 * static_cast<double>(bytes) / (1e-3 * ms));
    }
    return best;
}

void* CudaBackend::allocate(std::size_t bytes) {
    static_cast<void>(name());
    // Whole lines: byte-wide exchanges work on the word around a byte (base/atomic.h).
    constexpr std::size_t line = 256;
    void* memory = nullptr;
    RAYDIX_CUDA_TRY(cudaMalloc(&memory, (bytes + line - 1) / line * line));
    return memory;
}

void CudaBackend::free(void* memory) noexcept {
    // An error of an earlier launch that shows up here has been or will be thrown where it is asked
    // for.
    static_cast<void>(cudaFree(memory));
}

void CudaBackend::copy_to_device(void* device, const void* host, std::size_t bytes, Stream stream) {
    RAYDIX_CUDA_TRY(cudaMemcpyAsync(device, host, bytes, cudaMemcpyHostToDevice,
                                    static_cast<cudaStream_t>(stream)));
}

void CudaBackend::copy_to_host(void* host, const void* device, std::size_t bytes, Stream stream) {
    RAYDIX_CUDA_TRY(cudaMemcpyAsync(host, device, bytes, cudaMemcpyDeviceToHost,
                                    static_cast<cudaStream_t>(stream)));
}

DeviceBackend& cuda_backend() {
    static CudaBackend backend;
    return backend;
}

void list_cuda_devices(std::vector<DeviceDescription>& out) {
    DeviceDescription found{"cuda", "", "", ""};
    int driver = 0;
    if (cudaDriverGetVersion(&driver) == cudaSuccess && driver != 0)
        found.driver =
            "CUDA " + std::to_string(driver / 1000) + "." + std::to_string(driver % 1000 / 10);
    try {
        found.name = cuda_backend().name();
    } catch (const std::exception& error) {
        found.missing = error.what();
    }
    out.push_back(found);
}

}  // namespace raydix
