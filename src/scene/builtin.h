// Built-in scenes inside the library: specification and seed -> mesh and cameras.
// One maker per scene, each in builtin_<name>.cpp; builtin.cpp holds the list and reads the
// specification.
#pragma once

#include <raydix/camera.h>
#include <raydix/mesh.h>
#include <raydix/model.h>

#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

namespace raydix {

/// Closest hits of rays [n] on a mesh -> hits [n]. `lidar` needs one; the folder scene must not
/// know src/trace.
using SceneTracer = std::function<void(const Mesh&, std::span<const Ray>, std::span<Hit>)>;

struct BuiltinResult {
    Mesh mesh;
    CameraSet cameras;
};

/// `spec` is "NAME?key=value&key=value", without "builtin:". Throws InputError that names the part
/// at fault and lists what there is. The same bits for the same (spec, seed) on every machine and
/// for every thread count.
[[nodiscard]] BuiltinResult make_builtin(std::string_view spec, std::uint64_t seed,
                                         const SceneTracer& tracer);

namespace builtin {

/// The values of a request: given ones and defaults, all whole numbers within their limits.
class Arguments {
public:
    Arguments(std::span<const BuiltinParameter> parameters, std::vector<std::uint64_t> values)
        : parameters_(parameters), values_(std::move(values)) {}
    [[nodiscard]] std::uint64_t operator[](std::string_view name) const;

private:
    std::span<const BuiltinParameter> parameters_;
    std::vector<std::uint64_t> values_;
};

BuiltinResult make_atrium(std::uint64_t triangles, std::uint64_t seed);
BuiltinResult make_grove(std::uint64_t triangles, std::uint64_t seed);
BuiltinResult make_figure(std::uint64_t triangles, std::uint64_t seed);
BuiltinResult make_soup(std::uint64_t triangles, std::uint64_t seed);
BuiltinResult make_uniform(std::uint64_t points, std::uint64_t seed);
BuiltinResult make_clustered(std::uint64_t points, std::uint64_t clusters, std::uint64_t seed);

struct LidarOptions {
    std::uint64_t points = 0;     // how many echoes to collect
    std::uint64_t beams = 64;     // one above the other
    std::uint64_t triangles = 0;  // of the atrium that is scanned
    double noise = 0.01;          // deviation of the measured range, metres
    double dropout = 0.02;        // share of the echoes that are lost
};
BuiltinResult make_lidar(const LidarOptions& options, std::uint64_t seed,
                         const SceneTracer& tracer);

/// A camera of a built-in scene.
[[nodiscard]] Camera camera(std::string_view name, Vec3 position, Vec3 target, float vfov);

}  // namespace builtin
}  // namespace raydix
