// One reader per format: bytes -> mesh. Each throws InputError and holds no more than the bytes
// justify. The policy of each format is in docs/scenes.md.
#pragma once

#include <raydix/camera.h>
#include <raydix/mesh.h>

#include <functional>

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

/// Takes .gltf and .glb alike; the first four bytes tell which.
[[nodiscard]] Mesh load_gltf(ByteSource& in, const OpenExternal& open_external);

[[nodiscard]] CameraSet read_cameras(ByteSource& in);

}  // namespace raydix
