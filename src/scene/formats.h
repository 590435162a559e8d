// One reader per format: bytes -> mesh, or model. Each throws InputError and holds no more than the
// bytes justify. The policy of each format is in docs/scenes.md.
#pragma once

#include <raydix/camera.h>
#include <raydix/mesh.h>
#include <raydix/model.h>

#include <filesystem>
#include <functional>
#include <vector>

#include "scene/byte_source.h"

namespace raydix {

[[nodiscard]] Mesh load_ply(ByteSource& in);
[[nodiscard]] Mesh load_obj(ByteSource& in);
[[nodiscard]] Mesh load_stl(ByteSource& in);
[[nodiscard]] Mesh load_off(ByteSource& in);
[[nodiscard]] Mesh load_xyz(ByteSource& in);
[[nodiscard]] Mesh load_npy_points(ByteSource& in);

/// Opens a file that a glTF document names by a path relative to itself.
using OpenExternal = std::function<ByteSource(const std::filesystem::path& relative)>;

/// Takes .gltf and .glb alike; the first four bytes tell which. Without name and cameras.
[[nodiscard]] Model load_gltf(ByteSource& in, const OpenExternal& open_external);
/// The files that it would open.
[[nodiscard]] std::vector<std::filesystem::path> gltf_external_files(ByteSource& in);

/// A file by its extension. Without cameras; the name is made printable.
[[nodiscard]] Model load_file(const std::filesystem::path& file);
/// What load_file reads: the file, and what it names.
[[nodiscard]] std::vector<std::filesystem::path> files_of(const std::filesystem::path& file);

[[nodiscard]] CameraSet read_cameras(ByteSource& in);

}  // namespace raydix
