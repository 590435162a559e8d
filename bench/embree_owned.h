// Embree's handles with owners: a device, and scenes of any geometries on it.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "embree_api.h"

namespace raydix::bench {

class EmbreeDevice {
public:
    explicit EmbreeDevice(int threads)
        : device_(rtcNewDevice(("threads=" + std::to_string(threads)).c_str())) {}
    ~EmbreeDevice() { rtcReleaseDevice(device_); }
    EmbreeDevice(const EmbreeDevice&) = delete;
    EmbreeDevice& operator=(const EmbreeDevice&) = delete;

    [[nodiscard]] RTCDevice get() const { return device_; }
    void check() const {
        if (const RTCError error = rtcGetDeviceError(device_); error != RTC_ERROR_NONE)
            throw std::runtime_error("Embree reports error " + std::to_string(error));
    }

private:
    RTCDevice device_;
};

/// The device must outlive it. Geometries are numbered in the order in which they are added.
class EmbreeGroup {
public:
    EmbreeGroup(const EmbreeDevice& device, RTCBuildQuality quality, RTCSceneFlags flags)
        : device_(&device), quality_(quality), scene_(rtcNewScene(device.get())) {
        rtcSetSceneBuildQuality(scene_, quality);
        rtcSetSceneFlags(scene_, flags);
    }
    ~EmbreeGroup() {
        if (scene_ == nullptr) return;
        for (const RTCGeometry geometry : geometries_) rtcReleaseGeometry(geometry);
        rtcReleaseScene(scene_);
    }
    EmbreeGroup(EmbreeGroup&& other) noexcept
        : device_(other.device_),
          quality_(other.quality_),
          scene_(std::exchange(other.scene_, nullptr)),
          geometries_(std::move(other.geometries_)) {}
    EmbreeGroup(const EmbreeGroup&) = delete;
    EmbreeGroup& operator=(const EmbreeGroup&) = delete;

    /// describe(geometry) sets it up.
    template <class Describe>
    void add(RTCGeometryType type, const Describe& describe) {
        const RTCGeometry geometry = rtcNewGeometry(device_->get(), type);
        rtcSetGeometryBuildQuality(geometry, quality_);
        describe(geometry);
        rtcCommitGeometry(geometry);
        rtcAttachGeometryByID(scene_, geometry, static_cast<unsigned>(geometries_.size()));
        geometries_.push_back(geometry);
    }
    void commit() {
        rtcCommitScene(scene_);
        device_->check();
    }
    [[nodiscard]] RTCScene scene() const { return scene_; }
    [[nodiscard]] RTCGeometry geometry(std::size_t i) const { return geometries_[i]; }

private:
    const EmbreeDevice* device_;
    RTCBuildQuality quality_;
    RTCScene scene_;
    std::vector<RTCGeometry> geometries_;
};

}  // namespace raydix::bench
