#include "io/rdx_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace raydix::rdx {

std::string NameReader::next(std::uint32_t bytes) {
    if (bytes > rest_.size())
        sections_.fail("names",
                       fmt::format("a name of {} bytes, but {} are left", bytes, rest_.size()));
    const std::span<const char> name = rest_.first(bytes);
    rest_ = rest_.subspan(bytes);
    return {name.begin(), name.end()};
}

std::vector<raydix::Camera> NameReader::cameras(std::span<const Camera> packed) {
    std::vector<raydix::Camera> out;
    for (const Camera& c : packed)
        out.push_back({next(c.name_bytes), c.position, c.target, c.up, c.vfov});
    return out;
}

void NameReader::finish() const {
    if (!rest_.empty())
        sections_.fail("names", fmt::format("{} bytes belong to no name", rest_.size()));
}

PackedCameras::PackedCameras(std::string first_names, const std::vector<raydix::Camera>& from)
    : names(std::move(first_names)) {
    for (const raydix::Camera& c : from) {
        cameras.push_back({c.position, c.target, c.up, c.vfov, length_of(c.name)});
        names += c.name;
    }
}

Fault name_fault(std::span<const std::string> own, const CameraSet& cameras) {
    const auto too_long = [](const std::string& name) { return name.size() > UINT32_MAX; };
    if (!std::ranges::any_of(own, too_long) &&
        !std::ranges::any_of(cameras.cameras, too_long, &raydix::Camera::name))
        return {};
    return fmt::format("names: one has more than {} bytes", UINT32_MAX);
}

}  // namespace raydix::rdx
