// A model by name -> meshes, nodes and cameras: a file with the cameras beside it, or a built-in
// scene.
#include <raydix/bvh.h>
#include <raydix/camera.h>
#include <raydix/error.h>
#include <raydix/files.h>
#include <raydix/model.h>
#include <raydix/trace.h>

#include <string>
#include <string_view>
#include <vector>

#include "base/math.h"
#include "exec/parallel.h"
#include "measure/stopwatch.h"
#include "primitives/bounds.h"
#include "scene/builtin.h"
#include "scene/formats.h"
#include "scene/model_nodes.h"

namespace raydix {
namespace {

constexpr std::string_view builtin_prefix = "builtin:";

/// The scanner of `lidar` looks at the atrium with the library's own rays.
void trace_mesh(const Mesh& mesh, std::span<const Ray> rays, std::span<Hit> hits) {
    trace(build_bvh(mesh), rays, hits);
}

/// Around all vertices where the model shows them.
Aabb finite_bounds(const Model& model) {
    Aabb box = empty_box();
    const NodeWays ways(model);
    const auto add = [&](const Mesh& mesh, std::uint32_t node) {
        std::vector<Vec3> world;
        const std::vector<Vec3>* vertices = &mesh.vertices;
        if (!ways.stays(node)) {
            world.resize(mesh.vertices.size());
            for_each_index(world.size(),
                           [&](std::size_t i) { world[i] = ways.moved(node, (*vertices)[i]); });
            vertices = &world;
        }
        const PointSource source{vertices->data()};
        box = unite(box, scene_bounds(source, static_cast<std::uint32_t>(vertices->size())).box);
    };
    if (model.nodes.empty())
        for (const Mesh& mesh : model.meshes) add(mesh, NodeWays::world);
    for (std::uint32_t k = 0; k < model.nodes.size(); ++k)
        for (std::uint32_t i = 0; i < model.nodes[k].mesh_count; ++i)
            add(model.meshes[model.nodes[k].first_mesh + i], k);
    return box;
}

std::filesystem::path cameras_beside(const std::filesystem::path& file) {
    return file.parent_path() / "cameras.json";
}

/// Another program's file of this name is no reason not to give the geometry.
void take_cameras_beside(const std::filesystem::path& file, Model& model) {
    const std::filesystem::path beside = cameras_beside(file);
    std::error_code ignored;
    if (!std::filesystem::exists(beside, ignored)) return;
    try {
        model.cameras = load_cameras(beside);
    } catch (const InputError& error) {
        model.cameras_fault = error.what();
    }
}

}  // namespace

Model load_model(const std::string& spec, std::uint64_t seed) {
    Stopwatch watch;
    Model scene;
    if (spec.starts_with(builtin_prefix)) {
        BuiltinResult made =
            make_builtin(std::string_view(spec).substr(builtin_prefix.size()), seed, trace_mesh);
        scene.name = spec;
        scene.meshes.push_back(std::move(made.mesh));
        scene.cameras = std::move(made.cameras);
        scene.mesh().name = spec;
    } else {
        const std::filesystem::path file(spec);
        scene = load_file(file);
        scene.name = file.filename().string();
        take_cameras_beside(file, scene);
    }
    if (scene.cameras.cameras.empty())
        scene.cameras.cameras.push_back(fit_camera(finite_bounds(scene)));
    scene.load_ms = watch.lap();
    return scene;
}

std::vector<std::filesystem::path> files_of_model(const std::string& spec) {
    if (spec.starts_with(builtin_prefix)) return {};
    std::vector<std::filesystem::path> files = files_of(spec);
    files.push_back(cameras_beside(spec));
    return files;
}

Model load_flat_model(const std::string& spec, std::uint64_t seed) {
    Stopwatch watch;
    Model model = load_model(spec, seed);
    model.flatten();
    model.load_ms = watch.lap();
    return model;
}

}  // namespace raydix
