#include "io/rdx_names.h"

#include <fmt/format.h>

#include <algorithm>

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

std::vector<raydix::CameraD> NameReader::cameras(std::span<const CameraD> packed) {
    std::vector<raydix::CameraD> out;
    for (const CameraD& c : packed) {
        if (c.reserved != 0) sections_.fail("cameras", "the reserved bytes are not zero");
        out.push_back({next(c.name_bytes), c.position, c.target, c.up, c.vfov});
    }
    return out;
}

namespace {

template <class Set>
Fault long_name(std::span<const std::string> own, const Set& cameras) {
    const auto too_long = [](const std::string& name) { return name.size() > UINT32_MAX; };
    if (!std::ranges::any_of(own, too_long) &&
        !std::ranges::any_of(cameras.cameras,
                             [&](const auto& camera) { return too_long(camera.name); }))
        return {};
    return fmt::format("names: one has more than {} bytes", UINT32_MAX);
}

}  // namespace

Fault name_fault(std::span<const std::string> own, const CameraSet& cameras) {
    return long_name(own, cameras);
}
Fault name_fault(std::span<const std::string> own, const CameraSetD& cameras) {
    return long_name(own, cameras);
}

}  // namespace raydix::rdx
