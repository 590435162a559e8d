#if defined(RAYDIX_HAVE_HIP)

#include "exec/hip_device.h"

#include <array>
#include <string_view>

#include "exec/code_object.h"

namespace raydix {
namespace {

/// The device of this thread's calls; the caller's again at the end.
class OnDevice {
public:
    explicit OnDevice(int device) {
        hip_try(hip_api().GetDevice(&before_), "hipGetDevice");
        if (before_ == device) return;
        hip_try(hip_api().SetDevice(device), "hipSetDevice", std::to_string(device));
        changed_ = true;
    }
    ~OnDevice() {
        if (changed_) static_cast<void>(hip_api().SetDevice(before_));
    }
    OnDevice(const OnDevice&) = delete;
    OnDevice& operator=(const OnDevice&) = delete;

private:
    int before_ = 0;
    bool changed_ = false;
};

HipStream stream_of(Stream queue) { return static_cast<HipStream>(queue); }

/// Without what may follow: "gfx90a" of "gfx90a:sramecc+:xnack-". Code objects are compiled for
/// any.
std::string architecture_of(int device) {
    const HipApi& hip = hip_api();
    std::array<char, 8192> properties{};  // the largest so far has 1,472 bytes
    hip_try(hip.GetDeviceProperties(properties.data(), device), "hipGetDeviceProperties");
    const std::string text(properties.data() + hip.architecture_offset);
    if (!text.starts_with("gfx"))
        throw BackendUnavailable(
            "device hip: the runtime's hipDeviceProp_t is not laid out as in ROCm 5 to 7");
    return text.substr(0, text.find(':'));
}

std::string runtime_version() {
    int version = 0;
    if (hip_api().RuntimeGetVersion(&version) != hip_success) return {};
    return std::to_string(version / 10000000) + '.' + std::to_string(version / 100000 % 100);
}

}  // namespace

std::string hip_lacks(const HipFound& found) {
    if (!code_object(found.architecture).empty()) return {};
    return "device hip: " + found.name + " is " + found.architecture +
           "; this build has kernels for " + code_object_names();
}

std::vector<HipFound> find_hip_devices() {
    const HipApi& hip = hip_api();
    int count = 0;
    HipStatus status = hip.Init(0);
    if (status == hip_success) status = hip.GetDeviceCount(&count);
    if (status != hip_success)
        throw BackendUnavailable("device hip: the runtime found no device: " +
                                 hip_status_text(status));
    std::vector<HipFound> found;
    for (int k = 0; k < count; ++k) {
        std::array<char, 256> name{};
        int units = 0;
        hip_try(hip.DeviceGetName(name.data(), static_cast<int>(name.size()) - 1, k),
                "hipDeviceGetName");
        hip_try(hip.DeviceGetAttribute(&units, hip_multiprocessor_count, k),
                "hipDeviceGetAttribute");
        found.push_back({k, name.data(), architecture_of(k), runtime_version(),
                         static_cast<std::uint32_t>(units)});
    }
    return found;
}

void HipDevice::Release::operator()(HipModule module) const {
    static_cast<void>(hip_api().ModuleUnload(module));
}
void HipDevice::Release::operator()(HipStream stream) const {
    static_cast<void>(hip_api().StreamDestroy(stream));
}

HipDevice::HipDevice(const HipFound& found) : found_(found) {
    const std::string lacks = hip_lacks(found_);
    if (!lacks.empty()) throw BackendUnavailable(lacks);
    const HipApi& hip = hip_api();
    const OnDevice on(found_.index);
    HipModule module = nullptr;
    hip_try(hip.ModuleLoadData(&module, code_object(found_.architecture).data()),
            "hipModuleLoadData", "the kernels for " + found_.architecture);
    module_.reset(module);
    // Not the null stream, which waits for other streams.
    HipStream stream = nullptr;
    hip_try(hip.StreamCreateWithFlags(&stream, hip_stream_non_blocking),
            "hipStreamCreateWithFlags");
    own_stream_.reset(stream);
    const std::string wrong = wrong_arithmetic();
    if (!wrong.empty()) throw BackendUnavailable("device hip: " + found_.name + " " + wrong);
    note_open();
}

HipDevice::~HipDevice() {
    note_gone();
    close();
}

void HipDevice::close() noexcept {
    if (!closed_.exchange(true)) static_cast<void>(hip_api().StreamSynchronize(own_stream_.get()));
}

Stream HipDevice::queue(Stream given) { return given != nullptr ? given : own_stream_.get(); }

void* HipDevice::allocate(std::size_t bytes) {
    constexpr std::size_t line = 256;
    const OnDevice on(found_.index);
    void* memory = nullptr;
    hip_try(hip_api().Malloc(&memory, (bytes + line - 1) / line * line), "hipMalloc",
            std::to_string(bytes) + " bytes");
    if (reinterpret_cast<std::uintptr_t>(memory) % line != 0) {
        free(memory);
        throw DeviceError("hipMalloc: memory that is not aligned to 256 bytes");
    }
    return memory;
}

void HipDevice::free(void* memory) noexcept {
    if (closed_) return;
    static_cast<void>(hip_api().StreamSynchronize(own_stream_.get()));
    static_cast<void>(hip_api().Free(memory));
}

void HipDevice::copy(Stream queue, void* to, const void* from, std::size_t bytes) {
    if (bytes == 0) return;
    const OnDevice on(found_.index);
    hip_try(hip_api().MemcpyAsync(to, from, bytes, hip_memcpy_default, stream_of(queue)),
            "hipMemcpyAsync", std::to_string(bytes) + " bytes");
}

void HipDevice::clear(Stream queue, void* memory, std::size_t bytes) {
    if (bytes == 0) return;
    const OnDevice on(found_.index);
    hip_try(hip_api().MemsetAsync(memory, 0, bytes, stream_of(queue)), "hipMemsetAsync",
            std::to_string(bytes) + " bytes");
}

HipFunction HipDevice::function(const char* name) {
    const std::lock_guard lock(lock_);
    const auto known = functions_.find(std::string_view(name));
    if (known != functions_.end()) return known->second;
    HipFunction function = nullptr;
    hip_try(hip_api().ModuleGetFunction(&function, module_.get(), name), "hipModuleGetFunction",
            name);
    return functions_.emplace(name, function).first->second;
}

void HipDevice::launch(Stream queue, const KernelName& kernel, std::size_t groups,
                       std::size_t threads, const void* argument, std::size_t bytes) {
    const OnDevice on(found_.index);
    const auto word = [](HipLaunchParameter p) { return reinterpret_cast<void*>(p); };
    void* extra[] = {word(HipLaunchParameter::buffer_pointer), const_cast<void*>(argument),
                     word(HipLaunchParameter::buffer_size), &bytes, word(HipLaunchParameter::end)};
    hip_try(hip_api().ModuleLaunchKernel(function(kernel.kernel), static_cast<unsigned>(groups), 1,
                                         1, static_cast<unsigned>(threads), 1, 1, 0,
                                         stream_of(queue), nullptr, extra),
            "hipModuleLaunchKernel", kernel.kernel);
}

void HipDevice::finish(Stream queue) {
    const OnDevice on(found_.index);
    hip_try(hip_api().StreamSynchronize(stream_of(queue)), "hipStreamSynchronize", found_.name);
}

std::unique_ptr<HipDevice> open_hip_device(std::uint32_t index) {
    const std::vector<HipFound> found = find_hip_devices();
    if (index >= found.size())
        throw BackendUnavailable("device hip:" + std::to_string(index) + ": there are " +
                                 std::to_string(found.size()) + " HIP devices");
    return std::make_unique<HipDevice>(found[index]);
}

}  // namespace raydix

#endif
