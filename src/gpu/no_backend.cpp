// The rows of backends that this build was made without.
#include "gpu/backend.h"

namespace raydix {

#if !defined(RAYDIX_HAVE_CUDA)

namespace {

constexpr const char* no_cuda = "device cuda: this build of raydix has no CUDA";

/// All of its calls ask for a device first, and say that there is none.
class NoCuda final : public DeviceBackend {
public:
    NoCuda() : DeviceBackend("cuda") {}
    std::string name() override { throw BackendUnavailable(no_cuda); }
    void synchronize(Stream) override { throw BackendUnavailable(no_cuda); }
    void* allocate(std::size_t) override { throw BackendUnavailable(no_cuda); }
    void free(void*) noexcept override {}
    void copy_to_device(void*, const void*, std::size_t, Stream) override {
        throw BackendUnavailable(no_cuda);
    }
    void copy_to_host(void*, const void*, std::size_t, Stream) override {
        throw BackendUnavailable(no_cuda);
    }
    double measure_copy(std::size_t, int) override { throw BackendUnavailable(no_cuda); }
};

}  // namespace

DeviceBackend& cuda_backend() {
    static NoCuda backend;
    return backend;
}
void list_cuda_devices(std::vector<DeviceDescription>& out) {
    out.push_back({"cuda", "", "", no_cuda});
}

#endif

#if !defined(RAYDIX_HAVE_OPENCL)

namespace {
constexpr const char* no_opencl = "device opencl: this build of raydix has no OpenCL";
}

DeviceBackend& opencl_backend(std::uint32_t) { throw BackendUnavailable(no_opencl); }
void list_opencl_devices(std::vector<DeviceDescription>& out) {
    out.push_back({"opencl", "", "", no_opencl});
}
void* opencl_context() { throw BackendUnavailable(no_opencl); }
void* opencl_device_id() { throw BackendUnavailable(no_opencl); }

#endif

#if !defined(RAYDIX_HAVE_HIP)

namespace {
constexpr const char* no_hip = "device hip: this build of raydix has no kernels for HIP";
}

DeviceBackend& hip_backend(std::uint32_t) { throw BackendUnavailable(no_hip); }
void list_hip_devices(std::vector<DeviceDescription>& out) {
    out.push_back({"hip", "", "", no_hip});
}

#endif

}  // namespace raydix
