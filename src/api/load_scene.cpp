// A scene by name -> mesh and cameras: a file with the cameras beside it, or a built-in scene.
#include <raydix/bvh.h>
#include <raydix/camera.h>
#include <raydix/model.h>
#include <raydix/trace.h>

#include <string_view>

#include "base/math.h"
#include "measure/stopwatch.h"
#include "primitives/bounds.h"
#include "scene/builtin.h"

namespace raydix {
namespace {

constexpr std::string_view builtin_prefix = "builtin:";

/// The scanner of `lidar` looks at the atrium with the library's own rays.
void trace_mesh(const Mesh& mesh, std::span<const Ray> rays, std::span<Hit> hits) {
    trace(build_bvh(mesh), rays, hits);
}

Aabb finite_bounds(const Mesh& mesh) {
    const PointSource source{mesh.vertices.data()};
    return scene_bounds(source, static_cast<std::uint32_t>(mesh.vertices.size())).box;
}

}  // namespace

Model load_model(const std::string& spec, std::uint64_t seed) {
    Stopwatch watch;
    Model scene;
    if (spec.starts_with(builtin_prefix)) {
        BuiltinResult made =
            make_builtin(std::string_view(spec).substr(builtin_prefix.size()), seed, trace_mesh);
        scene.name = spec;
        scene.mesh = std::move(made.mesh);
        scene.cameras = std::move(made.cameras);
        scene.mesh.name = spec;
    } else {
        const std::filesystem::path file(spec);
        scene.mesh = load_mesh(file);
        scene.name = file.filename().string();
        const std::filesystem::path beside = file.parent_path() / "cameras.json";
        if (std::error_code ignored; std::filesystem::exists(beside, ignored))
            scene.cameras = load_cameras(beside);
    }
    if (scene.cameras.cameras.empty())
        scene.cameras.cameras.push_back(fit_camera(finite_bounds(scene.mesh)));
    scene.load_ms = watch.lap();
    return scene;
}

}  // namespace raydix
