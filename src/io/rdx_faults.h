// What an .rdx file may hold beyond its tree. The writer refuses what the reader would refuse.
#pragma once

#include <raydix/bvh.h>
#include <raydix/camera.h>
#include <raydix/mesh.h>

#include "tree/validate.h"

namespace raydix::rdx {

/// "SECTION: reason" if a camera could not come from a cameras.json.
[[nodiscard]] Fault camera_fault(const CameraSet& set);
[[nodiscard]] Fault camera_fault(const CameraSetD& set);

/// All invariants of the tree, that it belongs to the mesh, and the cameras.
[[nodiscard]] Fault content_fault(const Bvh& bvh, const Mesh& mesh, const CameraSet& cameras);

}  // namespace raydix::rdx
