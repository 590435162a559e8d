// The row of OpenCL in the table of backends: memory, queues and the launches of gpu/*.h.
#if defined(RAYDIX_HAVE_OPENCL)

#include <algorithm>
#include <chrono>
#include <map>
#include <mutex>

#include "exec/opencl_launcher.h"
#include "gpu/backend.h"
#include "gpu/device_build.h"
#include "gpu/kernel_names.h"

namespace raydix {
namespace {

double clock_ms() {
    using namespace std::chrono;
    return duration<double, std::milli>(steady_clock::now().time_since_epoch()).count();
}

class OpenclStageTimes;

/// OpenCL as gpu/device_run.h wants a machine.
struct OpenclMachine {
    using Sizer = OpenclSizer;
    using StageTimes = OpenclStageTimes;
    static constexpr std::size_t reserved_bytes = 0;
    OpenclDevice* device;

    [[nodiscard]] OpenclLauncher launcher(Stream stream, void* memory, std::size_t bytes) const {
        return {*device, device->queue(stream), memory, bytes};
    }
};

/// By the host's clock: a queue of the caller's need not keep times.
class OpenclStageTimes {
public:
    OpenclStageTimes(const OpenclMachine& machine, Stream stream)
        : device_(*machine.device), queue_(machine.device->queue(stream)) {
        device_.finish(queue_);
        first_ = last_ = clock_ms();
    }
    void operator()(const char* stage) {
        device_.finish(queue_);
        const double now = clock_ms();
        stage_ms(ms_, stage) += now - last_;
        last_ = now;
    }
    [[nodiscard]] BuildMs read() const {
        BuildMs ms = ms_;
        ms.total = last_ - first_;
        return ms;
    }

private:
    OpenclDevice& device_;
    cl_command_queue queue_;
    double first_, last_;
    BuildMs ms_;
};

class OpenclBackend final : public DeviceBackend {
public:
    OpenclBackend(std::uint32_t index, OpenclDevice& device)
        : DeviceBackend("opencl:" + std::to_string(index)), device_(device), machine_{&device} {}

    [[nodiscard]] OpenclDevice& device() { return device_; }

    std::string name() override { return device_.traits().name; }
    void synchronize(Stream stream) override { device_.finish(device_.queue(stream)); }
    void* allocate(std::size_t bytes) override { return device_.allocate(bytes); }
    void free(void* memory) noexcept override { device_.free(memory); }
    void copy_to_device(void* device, const void* host, std::size_t bytes,
                        Stream stream) override {
        device_.copy(device_.queue(stream), device, host, bytes);
    }
    void copy_to_host(void* host, const void* device, std::size_t bytes, Stream stream) override {
        device_.copy(device_.queue(stream), host, device, bytes);
    }
    double measure_copy(std::size_t bytes, int repeat) override {
        const DeviceBuffer<std::byte> from(bytes), to(bytes);
        cl_command_queue queue = device_.queue(nullptr);
        double best = 0;
        for (int turn = 0; turn <= repeat; ++turn) {
            const double start = clock_ms();
            device_.copy(queue, to.data(), from.data(), bytes);
            device_.finish(queue);
            const double ms = clock_ms() - start;
            if (turn > 0) best = std::max(best, 2.0 * static_cast<double>(bytes) / (1e-3 * ms));
        }
        return best;
    }

    std::size_t scratch_bytes(std::uint32_t n, const BuildOptions& options) override {
        return bvh_scratch_bytes<OpenclMachine>(n, options);
    }
    void build(const DeviceMesh& mesh, const BuildOptions& options, const DeviceTree& tree,
               Scratch scratch, Stream stream) override {
        run_on_stream(machine_, build_of(mesh, options, tree), scratch, stream);
    }
    void build(const DeviceBoxList& boxes, const BuildOptions& options, const DeviceTree& tree,
               Scratch scratch, Stream stream) override {
        run_on_stream(machine_, build_of(boxes, options, tree), scratch, stream);
    }
    BuildMs time(const DeviceMesh& mesh, const BuildOptions& options, const DeviceTree& tree,
                 Scratch scratch, Stream stream) override {
        return time_on_stream(machine_, build_of(mesh, options, tree), scratch, stream);
    }
    BuildMs time(const DeviceBoxList& boxes, const BuildOptions& options, const DeviceTree& tree,
                 Scratch scratch, Stream stream) override {
        return time_on_stream(machine_, build_of(boxes, options, tree), scratch, stream);
    }

private:
    OpenclDevice& device_;
    OpenclMachine machine_;
};

OpenclBackend& selected_opencl() {
    auto* backend = dynamic_cast<OpenclBackend*>(&device_backend());
    if (backend == nullptr)
        throw BackendUnavailable("device " + selected_device() + " is selected, not one of OpenCL");
    return *backend;
}

}  // namespace

DeviceBackend& opencl_backend(std::uint32_t index) {
    static std::mutex lock;
    static std::map<std::uint32_t, std::unique_ptr<OpenclBackend>> backends;
    const std::lock_guard guard(lock);
    std::unique_ptr<OpenclBackend>& backend = backends[index];
    if (backend == nullptr) backend = std::make_unique<OpenclBackend>(index, opencl_device(index));
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
