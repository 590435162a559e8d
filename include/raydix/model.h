// Models by name: what a file holds, or a built-in generator makes.
#pragma once

#include <raydix/camera.h>
#include <raydix/mesh.h>
#include <raydix/transform.h>
#include <raydix/types.h>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace raydix {

/// One `key=value` that a built-in scene understands.
struct BuiltinParameter {
    std::string_view name;
    double default_value;
    double min_value, max_value;
    std::string_view meaning;
};

/// A scene that the library makes itself, the same on every machine for the same parameters and
/// seed.
struct BuiltinScene {
    std::string_view name;
    std::string_view what;
    std::span<const BuiltinParameter> parameters;
};

[[nodiscard]] std::span<const BuiltinScene> builtin_scenes();

/// Places meshes of a Model, and the nodes below it: a node of glTF.
struct ModelNode {
    static constexpr std::uint32_t none = 0xFFFFFFFFu;

    std::string name;
    std::uint32_t parent = none;  // a node before this one; none: it stands in the world
    TransformD transform{};       // to the space of the parent
    std::uint32_t first_mesh = 0, mesh_count = 0;  // in Model::meshes
};

/// What a file holds. Rays are traced through a Scene (scene.h).
struct Model {
    std::string name;          // file name without folders, or the built-in's specification
    std::vector<Mesh> meshes;  // glTF: the primitives in document order; else one
    /// In depth-first order, parents before their children. Without nodes the meshes stand where
    /// they are. A file of one mesh in one node that does not move it has no nodes.
    std::vector<ModelNode> nodes;
    CameraSet
        cameras;  // from cameras.json beside the file, the built-in's own, or one fitted to the box
    double load_ms = 0.0;
    /// Why cameras.json beside the file gave no cameras, with its name; `cameras` is then one
    /// fitted to the box. Empty: it did, or there is none.
    std::string cameras_fault = {};

    /// The only mesh. Throws InputError if there are nodes or several meshes.
    [[nodiscard]] const Mesh& mesh() const&;
    [[nodiscard]] Mesh& mesh() &;
    [[nodiscard]] Mesh mesh() &&;
    [[nodiscard]] bool is_flat() const { return nodes.empty() && meshes.size() <= 1; }

    /// Makes one mesh of all, without nodes: node by node, mesh by mesh, in their order. Vertices
    /// go through each transform in turn in double and are rounded once: the bits of queries on a
    /// Scene. Where a node mirrors, two corners change places: the outside stays outside. Throws
    /// InputError, the model stays as it is: copies that take more than 64 MiB and 1,000 times the
    /// memory of the meshes, too many vertices or triangles for one mesh.
    void flatten();
};

/// Loads a file, or makes a built-in scene. `spec` is a path or "builtin:NAME?key=value&key=value".
/// `seed` drives built-in scenes. Files: .ply (ascii, binary little and big endian), .obj, .stl
/// (ascii, binary), .gltf, .glb, .off, .xyz or .npy, each also with .gz, .xz or .zst behind it.
/// Polygons are fanned in order. Coordinates are rounded to float: a SceneD of the model has those.
/// -0 becomes +0. Coordinates that are not finite are kept; builders leave such triangles out.
/// Memory stays in proportion to what the file really holds. Throws InputError for what cannot be
/// read or does not exist: "FILE: ELEMENT: reason"; not for a cameras.json beside the file, which
/// may be another program's (Model::cameras_fault).
[[nodiscard]] Model load_model(const std::string& spec, std::uint64_t seed = 1);

/// As load_model, then Model::flatten.
[[nodiscard]] Model load_flat_model(const std::string& spec, std::uint64_t seed = 1);

/// The file's model as one mesh (Model::flatten), without cameras. Throws InputError as both do.
[[nodiscard]] Mesh load_mesh(const std::filesystem::path& file);

}  // namespace raydix
