// Cameras and names of .rdx files: the cameras' numbers in one section, all names behind each other
// in another.
#pragma once

#include <raydix/camera.h>

#include <string>
#include <utility>
#include <vector>

#include "io/rdx_sections.h"
#include "tree/validate.h"

namespace raydix::rdx {

/// Takes names off the section, one after the other.
class NameReader {
public:
    NameReader(const Sections& sections, std::size_t id)
        : sections_(sections), rest_(sections.view<char>(id)) {}

    [[nodiscard]] std::string next(std::uint32_t bytes);
    [[nodiscard]] std::vector<raydix::Camera> cameras(std::span<const Camera> packed);
    [[nodiscard]] std::vector<raydix::CameraD> cameras(std::span<const CameraD> packed);
    /// Throws InputError if something is left.
    void finish() const;

private:
    const Sections& sections_;
    std::span<const char> rest_;
};

/// What is written: Packed is Camera or CameraD.
template <class Packed, class AnyCamera>
struct BasicPackedCameras {
    std::vector<Packed> cameras;
    std::string names;  // of the file's own things and of the cameras

    BasicPackedCameras(std::string first_names, const std::vector<AnyCamera>& from)
        : names(std::move(first_names)) {
        for (const AnyCamera& c : from) {
            Packed packed{};
            packed.position = c.position, packed.target = c.target, packed.up = c.up;
            packed.vfov = c.vfov;
            packed.name_bytes = static_cast<std::uint32_t>(c.name.size());
            cameras.push_back(packed);
            names += c.name;
        }
    }
};
using PackedCameras = BasicPackedCameras<Camera, raydix::Camera>;
using PackedCamerasD = BasicPackedCameras<CameraD, raydix::CameraD>;

/// `name_fault` has made sure that it fits.
[[nodiscard]] inline std::uint32_t length_of(const std::string& name) {
    return static_cast<std::uint32_t>(name.size());
}
[[nodiscard]] Fault name_fault(std::span<const std::string> own, const CameraSet& cameras);
[[nodiscard]] Fault name_fault(std::span<const std::string> own, const CameraSetD& cameras);

}  // namespace raydix::rdx
