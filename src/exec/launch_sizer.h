// What goes through a pipeline's launches (host_launcher.h tells their interface) without running
// one: for the largest piece of memory that a launcher needs for scans and sorts.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "base/probe.h"

namespace raydix {

/// The launches that need none. A launcher's sizer adds its scans and its sort.
class LaunchSizer {
public:
    using Probe = NoProbe;

    template <class Work>
    void launch(const char*, std::uint32_t, const Work&) {}
    template <class Work>
    void launch_counted(const char*, const std::uint32_t*, std::uint32_t, const Work&) {}
    template <class Work>
    void launch_warps(const char*, const std::uint32_t*, std::uint32_t, const Work&) {}
    template <class Work>
    void launch_tiles(const char*, std::uint32_t, const Work&) {}
    [[nodiscard]] bool maybe_any(const std::uint32_t*) const { return true; }

    [[nodiscard]] std::size_t bytes() const { return bytes_; }

protected:
    void grow(std::size_t bytes) { bytes_ = std::max(bytes_, bytes); }

private:
    std::size_t bytes_ = 0;
};

}  // namespace raydix
