#include "exec/kernel_device.h"

#include <cstdlib>
#include <mutex>
#include <vector>

#include "exec/arithmetic_check.h"
#include "exec/kernel_arguments.h"

namespace raydix {
namespace {

/// A driver's threads that still run commands when a process ends use what its static destructors
/// destroy: Intel's ends with "Pure virtual function called!".
class OpenDevices {
public:
    static OpenDevices& all() {
        static auto* devices = new OpenDevices;  // never destroyed: end() is called late
        return *devices;
    }
    void add(KernelDevice* device) {
        const std::lock_guard lock(lock_);
        devices_.push_back(device);
    }
    void remove(KernelDevice* device) {
        const std::lock_guard lock(lock_);
        std::erase(devices_, device);
    }

    static void end() {
        const std::lock_guard lock(all().lock_);
        for (KernelDevice* device : all().devices_) device->close();
    }

private:
    std::mutex lock_;
    std::vector<KernelDevice*> devices_;
};

}  // namespace

void KernelDevice::close_before_driver() { static_cast<void>(std::atexit(OpenDevices::end)); }
void KernelDevice::note_open() {
    OpenDevices::all().add(this);
    close_before_driver();
}
void KernelDevice::note_gone() noexcept { OpenDevices::all().remove(this); }

std::string KernelDevice::wrong_arithmetic() {
    constexpr std::uint32_t n = arithmetic_cases;
    struct Memory {
        KernelDevice& device;
        void* bytes;
        explicit Memory(KernelDevice& on)
            : device(on), bytes(on.allocate(n * sizeof(ArithmeticResults))) {}
        ~Memory() { device.free(bytes); }
        Memory(const Memory&) = delete;
        Memory& operator=(const Memory&) = delete;
    } memory(*this);
    const Stream own = queue(nullptr);
    const EachArguments<ComputeCases> given{{static_cast<ArithmeticResults*>(memory.bytes)}, n};
    launch(own, {"sort", "each_compute_cases"}, (n + group_threads - 1) / group_threads,
           group_threads, &given, sizeof(given));
    std::vector<ArithmeticResults> results(n);
    copy(own, results.data(), memory.bytes, n * sizeof(ArithmeticResults));
    finish(own);
    return first_wrong_case(results);
}

}  // namespace raydix
