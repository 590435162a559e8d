// Models by name: what a file holds, or a built-in generator makes.
#pragma once

#include <raydix/camera.h>
#include <raydix/mesh.h>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace raydix {

/// Reads .ply (ascii, binary little and big endian), .obj, .stl (ascii, binary), .gltf, .glb, .off,
/// .xyz or .npy, each also with .gz, .xz or .zst behind it. Polygons are fanned in order; the
/// meshes of a glTF scene follow each other. -0 becomes +0. Non-finite coordinates are kept
/// (builders leave such triangles out). Throws InputError: "FILE: ELEMENT: reason". Memory stays in
/// proportion to what the file really holds.
[[nodiscard]] Mesh load_mesh(const std::filesystem::path& file);

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

/// A mesh with what belongs to it: what a file holds. Rays are traced through a Scene (scene.h).
struct Model {
    std::string name;  // file name without folders, or the built-in's specification
    Mesh mesh;
    CameraSet
        cameras;  // from cameras.json beside the file, the built-in's own, or one fitted to the box
    double load_ms = 0.0;
};

/// `spec` is a file path, or "builtin:NAME?key=value&key=value". `seed` drives built-in scenes.
/// Throws InputError for anything that cannot be read or does not exist.
[[nodiscard]] Model load_model(const std::string& spec, std::uint64_t seed = 1);

}  // namespace raydix
