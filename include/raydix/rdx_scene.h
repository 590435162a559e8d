// .rdx files that hold a whole scene. Those of one tree: raydix/rdx.h.
#pragma once

#include <raydix/camera.h>
#include <raydix/scene.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace raydix {

/// Saves a scene as its last commit left it, with all scenes that stand in it, each of them once,
/// with the vertices and triangles of its meshes, and with its spheres, capsules and points. Ids
/// that were given stay given. Throws InputError: changes that no commit has taken in; user
/// geometry, whose function has no place in a file (it is named); shared arrays that changed since
/// the commit; a file that cannot be written.
void save_rdx(const std::filesystem::path& file, const Scene& scene, const std::string& name = {},
              const CameraSet& cameras = {});

/// The same of a scene in double. Every double of it is in the file as it is; trees are not, and
/// loading builds them.
void save_rdx(const std::filesystem::path& file, const SceneD& scene, const std::string& name = {},
              const CameraSetD& cameras = {});

/// What a file of a scene holds, each thing counted once.
struct RdxCounts {
    std::uint64_t scenes = 0;     // the whole and those that stand in it
    std::uint64_t instances = 0;  // of all of them
    std::uint64_t meshes = 0;     // that have triangles
    std::uint64_t vertices = 0, triangles = 0;
    std::uint64_t shapes = 0;  // spheres, capsules and points
    std::uint64_t nodes = 0;   // of trees of triangles
    std::uint64_t bytes = 0;   // of the file
};

/// What such a file gives back.
template <class Scalar>
struct BasicRdxScene {
    /// Committed. Its arrays, and in float the trees of its meshes, view the mapped file, which
    /// stays mapped as long as one of them is in use: processes that load it share its memory.
    /// Nodes of trees whose planes move when they are loaded (docs/algorithms/wide.md, local pads)
    /// do not. Other trees are built.
    BasicScene<Scalar> scene;
    SceneOptions options;  // quality, usage and compact as its last commit had them
    std::string name;
    BasicCameraSet<Scalar> cameras;
    RdxCounts counts;                      // in double without nodes
    std::vector<std::uint32_t> shape_ids;  // ascending: geometries of the scene itself that hold
                                           // spheres, capsules or points
    double load_ms = 0;
};
using RdxScene = BasicRdxScene<float>;
using RdxSceneD = BasicRdxScene<double>;

/// Loads a scene. Maps the file and validates it before anything is used. It must not be changed in
/// place while the scene lives; to replace it by renaming is safe. Rays have the hits of the scene
/// that was saved, bit for bit. Throws InputError: "FILE: SECTION: reason".
[[nodiscard]] RdxScene load_rdx_scene(const std::filesystem::path& file);
[[nodiscard]] RdxSceneD load_rdx_scene_double(const std::filesystem::path& file);

/// Whether it is a regular file that begins as .rdx files do, whatever its name. False for one that
/// cannot be read.
[[nodiscard]] bool is_rdx_file(const std::filesystem::path& file);
/// Whether an .rdx file holds a scene (load_rdx_scene), not a tree (load_rdx). Reads its header
/// alone. Throws InputError if it is no .rdx file.
[[nodiscard]] bool holds_scene(const std::filesystem::path& file);
/// Whether it holds a scene in double (load_rdx_scene_double).
[[nodiscard]] bool holds_scene_double(const std::filesystem::path& file);

}  // namespace raydix
