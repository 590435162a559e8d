// The end of a process that has left work on an OpenCL device: the library waits for it before the
// driver's static destructors run, and memory of static storage is let go after that. A program,
// because it is judged by how it ends.
#include <raydix/device.h>
#include <raydix/error.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <vector>

namespace {

constexpr std::uint8_t last = 0xA7;
std::array<std::uint8_t, 4096> arrived{};

// Made before the driver is loaded, so that they are destroyed after the library has waited: the
// verdict first, because buffers wait too when they are freed before.
raydix::DeviceBuffer<std::uint8_t> from, between;

struct Verdict {
    bool expected = false;
    ~Verdict() {
        if (!expected || arrived.back() == last) return;
        std::puts("the process ended before the work on its device");
        std::_Exit(1);
    }
} verdict;

}  // namespace

int main() {
    try {
        raydix::select_device("opencl");
    } catch (const raydix::BackendUnavailable& reason) {
        std::puts(reason.what());
        const char* required = std::getenv("RAYDIX_DEVICE_REQUIRED");
        return required != nullptr && std::string_view(required) == "opencl" ? 1 : 77;
    }
    constexpr std::size_t bytes = std::size_t{1} << 24;
    from = raydix::DeviceBuffer<std::uint8_t>(std::vector<std::uint8_t>(bytes, last));
    between.reset(bytes);
    // 0.8 GB to copy, and nothing waits for it.
    for (int turn = 0; turn < 50; ++turn)
        raydix::detail::copy_to_device(between.data(), from.data(), bytes, nullptr);
    raydix::detail::copy_to_host(arrived.data(), between.data(), arrived.size(), nullptr);
    verdict.expected = true;
}
