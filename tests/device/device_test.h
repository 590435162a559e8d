// What tests of a device have in common: the device that RAYDIX_TEST_DEVICE names, cuda if nothing
// does. Where it is not there they are skipped with its reason; where RAYDIX_DEVICE_REQUIRED names
// it, they fail instead.
#pragma once

#include <gtest/gtest.h>
#include <raydix/device.h>
#include <raydix/error.h>
#include <raydix/mesh.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

namespace raydix::test {

inline std::string environment(const char* name, const char* otherwise) {
    const char* value = std::getenv(name);
    return value != nullptr ? value : otherwise;
}

class DeviceTest : public ::testing::Test {
protected:
    void SetUp() override {
        const std::string device = environment("RAYDIX_TEST_DEVICE", "cuda");
        try {
            select_device(device);
        } catch (const BackendUnavailable& reason) {
            if (environment("RAYDIX_DEVICE_REQUIRED", "") == device) FAIL() << reason.what();
            GTEST_SKIP() << reason.what();
        }
    }
};

/// A mesh on the device.
struct Uploaded {
    DeviceBuffer<Vec3> vertices;
    DeviceBuffer<Triangle> triangles;
    DeviceMesh mesh;

    explicit Uploaded(const MeshView& view) : vertices(view.vertices), triangles(view.triangles) {
        mesh = {vertices.data(), static_cast<std::uint32_t>(vertices.size()), triangles.data(),
                static_cast<std::uint32_t>(triangles.size())};
    }
    [[nodiscard]] PrimitiveKind kind() const {
        return mesh.triangle_count != 0 ? PrimitiveKind::triangles : PrimitiveKind::points;
    }
    [[nodiscard]] std::uint32_t count() const {
        return mesh.triangle_count != 0 ? mesh.triangle_count : mesh.vertex_count;
    }
};

/// Whether a processor plays the device: then sizes are small.
inline bool on_opencl() { return selected_device().starts_with("opencl"); }
inline std::size_t fitting(std::size_t n) { return on_opencl() ? std::min(n, n / 50 + 100) : n; }
/// All, or a few of them.
template <class T>
std::vector<T> fitting(std::vector<T> all) {
    if (on_opencl() && all.size() > 4) all.resize(4);
    return all;
}

}  // namespace raydix::test
