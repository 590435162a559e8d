// A queue of OpenCL or HIP as gpu/device_run.h wants a machine.
#pragma once

#include <raydix/device.h>

#include <chrono>

#include "exec/queue_launcher.h"
#include "gpu/device_run.h"
#include "gpu/kernel_names.h"

namespace raydix {

inline double queue_clock_ms() {
    using namespace std::chrono;
    return duration<double, std::milli>(steady_clock::now().time_since_epoch()).count();
}

class QueueStageTimes;

struct QueueMachine {
    using Sizer = QueueSizer;
    using StageTimes = QueueStageTimes;
    static constexpr std::size_t reserved_bytes = 0;
    KernelDevice* device;

    [[nodiscard]] QueueLauncher launcher(Stream stream, void* memory, std::size_t bytes) const {
        return {*device, device->queue(stream), memory, bytes};
    }
};

/// By the host's clock: a queue of the caller's need not keep times.
class QueueStageTimes {
public:
    QueueStageTimes(const QueueMachine& machine, Stream stream)
        : device_(*machine.device), queue_(machine.device->queue(stream)) {
        device_.finish(queue_);
        first_ = last_ = queue_clock_ms();
    }
    void operator()(const char* stage) {
        device_.finish(queue_);
        const double now = queue_clock_ms();
        stage_ms(ms_, stage) += now - last_;
        last_ = now;
    }
    [[nodiscard]] BuildMs read() const {
        BuildMs ms = ms_;
        ms.total = last_ - first_;
        return ms;
    }

private:
    KernelDevice& device_;
    Stream queue_;
    double first_, last_;
    BuildMs ms_;
};

}  // namespace raydix
