// A mesh as an Embree scene, sharing the mesh's arrays.
#pragma once

#include <raydix/mesh.h>

#include <atomic>
#include <cstdint>
#include <stdexcept>
#include <string>

#include "embree_api.h"

namespace raydix::bench {

struct EmbreeOptions {
    int threads = 0;
    RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM;  // of the scene and of the geometry
    RTCSceneFlags flags = RTC_SCENE_FLAG_NONE;
    bool count_bytes = false;  // costs a call for each block of memory
};

/// Committed by the caller, so that the commit can be timed. The mesh must outlive it, and its
/// vertex array must have one more element behind the last (Embree reads 16 bytes a vertex).
class EmbreeScene {
public:
    EmbreeScene(const Mesh& mesh, const EmbreeOptions& options)
        : device_(rtcNewDevice(("threads=" + std::to_string(options.threads)).c_str())),
          scene_(rtcNewScene(device_)) {
        if (options.count_bytes) rtcSetDeviceMemoryMonitorFunction(device_, note_bytes, &bytes_);
        rtcSetSceneBuildQuality(scene_, options.quality);
        rtcSetSceneFlags(scene_, options.flags);
        geometry_ = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
        rtcSetGeometryBuildQuality(geometry_, options.quality);
        rtcSetSharedGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                   mesh.vertices.data(), 0, sizeof(Vec3), mesh.vertices.size());
        rtcSetSharedGeometryBuffer(geometry_, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                   mesh.triangles.data(), 0, sizeof(Triangle),
                                   mesh.triangles.size());
        rtcCommitGeometry(geometry_);
        rtcAttachGeometryByID(scene_, geometry_, 0);
        check();
    }
    ~EmbreeScene() {
        rtcReleaseGeometry(geometry_);
        rtcReleaseScene(scene_);
        rtcReleaseDevice(device_);
    }
    EmbreeScene(const EmbreeScene&) = delete;
    EmbreeScene& operator=(const EmbreeScene&) = delete;

    void commit() {
        rtcCommitScene(scene_);
        check();
    }
    /// Says that all vertices moved, so that the next commit builds again.
    void touch() {
        rtcUpdateGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0);
        rtcCommitGeometry(geometry_);
    }
    [[nodiscard]] RTCScene scene() const { return scene_; }
    /// What Embree has taken and not given back, by its own count. 0 unless asked for.
    [[nodiscard]] std::uint64_t bytes() const { return static_cast<std::uint64_t>(bytes_.load()); }

private:
    static bool note_bytes(void* sum, ssize_t bytes, bool) {
        *static_cast<std::atomic<std::int64_t>*>(sum) += bytes;
        return true;
    }
    void check() const {
        if (const RTCError error = rtcGetDeviceError(device_); error != RTC_ERROR_NONE)
            throw std::runtime_error("Embree reports error " + std::to_string(error));
    }
    std::atomic<std::int64_t> bytes_ = 0;  // outlives the device, which still counts at its end
    RTCDevice device_;
    RTCScene scene_;
    RTCGeometry geometry_;
};

}  // namespace raydix::bench
